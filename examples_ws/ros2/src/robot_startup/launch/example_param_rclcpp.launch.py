"""Start one node twice: its level comes from the argument log_level, and from the file of its package."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = "example_parameters_rclcpp"


def generate_launch_description():
    level = DeclareLaunchArgument("log_level", default_value="40", description="10 debug to 50 fatal")
    # Two nodes of one name need two namespaces.
    by_argument = Node(
        package=PACKAGE,
        executable="parameters_basic",
        namespace="by_argument",
        # Arguments are text, the parameter is a number.
        parameters=[{"rcl_log_level": ParameterValue(LaunchConfiguration("log_level"), value_type=int)}],
    )
    by_file = Node(
        package=PACKAGE,
        executable="parameters_basic",
        namespace="by_file",
        parameters=[str(Path(get_package_share_directory(PACKAGE), "config", "parameters.yaml"))],
    )
    return LaunchDescription([level, by_argument, by_file])
