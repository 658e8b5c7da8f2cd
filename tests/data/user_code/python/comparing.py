"""Messages are compared, copied, sorted, kept in collections and sent to other processes."""

import copy
import pickle
from operator import attrgetter

import pytest
from geometry_msgs.msg import Point, PointStamped, Vector3
from nav_msgs.msg import Path
from rover.msg import Route, Waypoint
from sensor_msgs.msg import Imu

assert Point(x=1.0) == Point(x=1.0)
assert Point(x=1.0) != Point(x=2.0)
assert Point() != Vector3(), "another class, other things"
assert Point(x=3.0) in [Point(x=1.0), Point(x=3.0)]
with pytest.raises(TypeError):
    hash(Point())

far = sorted([Point(x=3.0), Point(x=1.0)], key=attrgetter("x"))
assert [point.x for point in far] == [1.0, 3.0]

route = Route(waypoints=[Waypoint(name="gate")], sketch=b"abc")
shallow, deep = copy.copy(route), copy.deepcopy(route)
assert route == shallow == deep
route.waypoints[0].name = "barn"
route.sketch.append(7)
assert shallow.waypoints[0].name == "barn"
assert deep.waypoints[0].name == "gate"
assert bytes(deep.sketch) == b"abc"

for original in (route, Imu(), Path(), PointStamped(point=Point(y=2.0))):
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        assert pickle.loads(pickle.dumps(original, protocol)) == original
