"""Publish a command to a robot twice a second, on the topic /command."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class TopicPublisher02(Node):
    """A node that publishes on a timer."""

    def __init__(self):
        super().__init__("topic_publisher_02")
        # Keep up to ten messages for a slow subscriber.
        self.publisher = self.create_publisher(String, "command", 10)
        self.timer = self.create_timer(0.5, self.publish)

    def publish(self):
        command = String(data="backward")
        self.get_logger().info(f"publishing '{command.data}'")
        self.publisher.publish(command)


def main():
    rclpy.init()
    node = TopicPublisher02()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl+C is the normal way to stop a node.
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
