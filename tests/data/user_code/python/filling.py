"""Fields from dictionaries, as command lines give them; times are filled in at the moment of sending."""

import pytest
import yaml
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Twist
from rosidl_runtime_py.set_message import set_message_fields
from rosidl_runtime_py.utilities import get_message
from rover.msg import Route

twist = Twist()
set_message_fields(twist, yaml.safe_load("{linear: {x: 1}, angular: {z: '0.5'}}"))
assert (twist.linear.x, twist.angular.z) == (1.0, 0.5)

pose = PoseStamped()
open_times = set_message_fields(pose, {"header": "auto"}, expand_header_auto=True, expand_time_now=True)
assert len(open_times) == 1
for fill in open_times:
    fill(Time(sec=9))
assert pose.header.stamp.sec == 9

route = Route()
open_times = set_message_fields(
    route,
    {
        "header": {"stamp": "now", "frame_id": "map"},
        "waypoints": [{"name": "gate"}, {"name": "barn", "position": {"y": 2}}],
        "covariance": [1, 2, 3, 4, 5, 6],
        "sketch": [1, 2],
        "flags": [True, False, True],
    },
    expand_time_now=True,
)
for fill in open_times:
    fill(Time(nanosec=5))
assert route.header.stamp == Time(nanosec=5)
assert [(place.name, place.position.y) for place in route.waypoints] == [("gate", 0.0), ("barn", 2.0)]
assert route.covariance.tolist() == [1, 2, 3, 4, 5, 6]
assert (bytes(route.sketch), route.flags) == (b"\1\2", [True, False, True])

message = get_message("std_msgs/msg/Int32")()
set_message_fields(message, {"data": "17"})
assert message.data == 17

with pytest.raises(AttributeError):
    set_message_fields(twist, {"speed": 1})
with pytest.raises(TypeError, match="expected to be a dictionary"):
    set_message_fields(twist, {"linear": 5})
