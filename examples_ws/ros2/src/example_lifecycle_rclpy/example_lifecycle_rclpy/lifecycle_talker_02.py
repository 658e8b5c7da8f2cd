"""Publish a message twice a second, but only while the node is active.

ros2 lifecycle set /lifecycle_talker_02 configure
ros2 lifecycle set /lifecycle_talker_02 activate
"""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from std_msgs.msg import String


class LifecycleTalker02(LifecycleNode):
    """A node whose resources exist only between configure and cleanup."""

    def __init__(self):
        super().__init__("lifecycle_talker_02")
        self.publisher = None
        self.timer = None

    def on_configure(self, state):
        self.publisher = self.create_lifecycle_publisher(String, "chatter", 10)
        self.timer = self.create_timer(0.5, self.publish)
        self.get_logger().info("configured")
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        self.get_logger().info("active")
        # The base class activates the publisher.
        return super().on_activate(state)

    def on_deactivate(self, state):
        self.get_logger().info("inactive")
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        self.destroy_timer(self.timer)
        self.destroy_publisher(self.publisher)
        self.get_logger().info("cleaned up")
        return TransitionCallbackReturn.SUCCESS

    def publish(self):
        # A lifecycle publisher drops messages while the node is inactive.
        if self.publisher.is_activated:
            self.get_logger().info("publishing")
            self.publisher.publish(String(data="I am active"))


def main():
    rclpy.init()
    node = LifecycleTalker02()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl+C is the normal way to stop a node.
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
