"""Read a RobotPose as YAML from a file or standard input and report it in one line."""

import sys
from pathlib import Path

import yaml
from example_ros2_interfaces.msg import RobotPose
from rosidl_runtime_py import set_message_fields


def main():
    text = Path(sys.argv[1]).read_text() if len(sys.argv) > 1 else sys.stdin.read()
    message = RobotPose()
    set_message_fields(message, yaml.safe_load(text))
    print(report(message))


def report(message):
    """Return the line that robot_demo_cpp prints for an equal message."""
    position, orientation = message.pose.position, message.pose.orientation
    return (
        f"status {message.status}"
        f", position ({position.x:.4f}, {position.y:.4f}, {position.z:.4f})"
        f", orientation ({orientation.x:.4f}, {orientation.y:.4f}"
        f", {orientation.z:.4f}, {orientation.w:.4f})"
    )
