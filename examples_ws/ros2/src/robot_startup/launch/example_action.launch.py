"""Start the robot and who sends it three metres ahead; all ends when it is there."""

from launch import LaunchDescription
from launch.actions import Shutdown
from launch_ros.actions import Node


def generate_launch_description():
    robot = Node(package="example_action_rclcpp", executable="action_robot_01")
    control = Node(
        package="example_action_rclcpp",
        executable="action_control_01",
        parameters=[{"distance": 3.0}],
        # The robot would wait for more goals forever.
        on_exit=Shutdown(),
    )
    return LaunchDescription([robot, control])
