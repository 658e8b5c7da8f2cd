"""Load two components into one process; messages between them are not copied."""

from launch import LaunchDescription
from launch_ros.actions import ComposableNodeContainer
from launch_ros.descriptions import ComposableNode

PACKAGE = "example_composition_rclcpp"


def generate_launch_description():
    without_copies = [{"use_intra_process_comms": True}]
    container = ComposableNodeContainer(
        name="container",
        namespace="",
        package="rclcpp_components",
        executable="component_container",
        composable_node_descriptions=[
            ComposableNode(
                package=PACKAGE,
                plugin="example_composition::ComposedPublisher",
                extra_arguments=without_copies,
            ),
            ComposableNode(
                package=PACKAGE,
                plugin="example_composition::ComposedSubscriber",
                extra_arguments=without_copies,
            ),
        ],
    )
    return LaunchDescription([container])
