"""Subscribe to /command and log the speed that each command stands for."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String

SPEEDS = {"forward": 0.2, "backward": -0.2}  # [m/s]


class TopicSubscribe02(Node):
    """A node with a subscription."""

    def __init__(self):
        super().__init__("topic_subscribe_02")
        self.subscription = self.create_subscription(String, "command", self.obey, 10)

    def obey(self, command):
        """Log the speed; an unknown command stops the robot."""
        speed = SPEEDS.get(command.data, 0.0)
        self.get_logger().info(f"heard '{command.data}': {speed:.1f} m/s")


def main():
    rclpy.init()
    node = TopicSubscribe02()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl+C is the normal way to stop a node.
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
