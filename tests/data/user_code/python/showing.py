"""Messages as text: repr for people, YAML and CSV for files, dictionaries for programs."""

import json

import yaml
from geometry_msgs.msg import Point, PoseStamped
from rosidl_runtime_py import (
    message_to_csv,
    message_to_ordereddict,
    message_to_yaml,
    set_message_fields,
)
from rover.msg import Route, Waypoint
from std_msgs.msg import Empty, Header, UInt8MultiArray

assert repr(Point(x=1.5)) == "geometry_msgs.msg.Point(x=1.5, y=0.0, z=0.0)"
assert repr(Header(frame_id="map")) == (
    "std_msgs.msg.Header(stamp=builtin_interfaces.msg.Time(sec=0, nanosec=0), frame_id='map')"
)
assert "data=[1, 2]" in repr(UInt8MultiArray(data=[1, 2]))
assert f"{Empty()}" == "std_msgs.msg.Empty()"

assert message_to_yaml(Point(z=-1.0)) == "x: 0.0\ny: 0.0\nz: -1.0\n"
assert message_to_csv(PoseStamped(header=Header(frame_id="odom"))) == "0,0,odom,0.0,0.0,0.0,0.0,0.0,0.0,1.0"

route = Route(waypoints=[Waypoint(name="gate", position=Point(x=2.0))], tags=["a", "b"], sketch=bytes(200))
plain = message_to_ordereddict(route)
assert list(plain)[:3] == ["header", "kind", "waypoints"]
assert plain["waypoints"][0]["position"]["x"] == 2.0
assert json.loads(json.dumps(plain))["weights"] == [0.25, 0.75]

copied = Route()
set_message_fields(copied, yaml.safe_load(message_to_yaml(route)))
assert copied == route

short = message_to_ordereddict(route, truncate_length=3)
assert short["sketch"] == [0, 0, 0, "..."]
assert short["waypoints"][0]["name"] == "gat..."
assert "length: 200" in message_to_yaml(route, no_arr=True)
