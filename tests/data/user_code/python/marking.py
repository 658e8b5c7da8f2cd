"""Markers, transforms and time: the small change of every robot program."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Quaternion, TransformStamped, Vector3
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

BILLION = 10**9


def after(time: Time, duration: Duration) -> Time:
    nanoseconds = (time.sec + duration.sec) * BILLION + time.nanosec + duration.nanosec
    return Time(sec=nanoseconds // BILLION, nanosec=nanoseconds % BILLION)


def turned(yaw: float) -> Quaternion:
    return Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def yaw_of(rotation: Quaternion) -> float:
    return 2 * math.atan2(rotation.z, rotation.w)


frame = TransformStamped(child_frame_id="base_link")
frame.header.frame_id = "odom"
frame.header.stamp = after(Time(sec=1, nanosec=900_000_000), Duration(nanosec=200_000_000))
frame.transform.translation = Vector3(x=1.0)
frame.transform.rotation = turned(0.5)
assert frame.header.stamp == Time(sec=2, nanosec=100_000_000)
assert math.isclose(yaw_of(frame.transform.rotation), 0.5)
tree = {transform.child_frame_id: transform for transform in TFMessage(transforms=[frame]).transforms}
assert tree["base_link"].header.frame_id == "odom"

line = Marker(header=frame.header, ns="path", type=Marker.LINE_STRIP, lifetime=Duration(sec=5))
line.scale.x = 0.05
line.color = ColorRGBA(g=1.0, a=1.0)
line.points = [Point(x=float(i), y=math.sin(i)) for i in range(10)]
line.colors.extend([line.color] * len(line.points))
markers = MarkerArray()
markers.markers.append(line)
assert len(markers.markers[0].points) == len(markers.markers[0].colors) == 10
