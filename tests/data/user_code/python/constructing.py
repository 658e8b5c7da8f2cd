"""Messages made with keywords, piece by piece, and all at once."""

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, Vector3
from std_msgs.msg import ColorRGBA, Header, String


def goal(x: float, y: float) -> PoseStamped:
    pose = PoseStamped()
    pose.header.frame_id = "map"
    pose.header.stamp = Time(sec=12, nanosec=500)
    pose.pose.position.x = x
    pose.pose.position.y = y
    return pose


there = goal(1.0, 2.0)
same = PoseStamped(
    header=Header(frame_id="map", stamp=Time(sec=12, nanosec=500)),
    pose=Pose(position=Point(x=1.0, y=2.0), orientation=Quaternion()),
)
assert there == same
assert there.pose.orientation.w == 1.0
assert String().data == ""

drive = Twist(linear=Vector3(x=0.2), angular=Vector3(z=-1.0))
drive.linear.x *= 2
assert (drive.linear.x, drive.angular.z, drive.linear.y) == (0.4, -1.0, 0.0)

settings = {"r": 1.0, "a": 0.5}
color = ColorRGBA(**settings)
assert (color.r, color.g, color.b, color.a) == (1.0, 0.0, 0.0, 0.5)

first, second = Pose(), Pose()
first.position.x = 5.0
assert second.position.x == 0.0, "messages share nothing"
