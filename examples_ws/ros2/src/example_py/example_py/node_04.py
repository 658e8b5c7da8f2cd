"""A node as a class: what a node owns, its publishers, timers and so on, becomes attributes of it."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Node04(Node):
    """A node that introduces itself, once a second."""

    def __init__(self, name):
        super().__init__(name)
        self.times = 0
        self.timer = self.create_timer(1.0, self.introduce)

    def introduce(self):
        """Say who we are; a name may have been remapped on the command line."""
        self.times += 1
        self.get_logger().info(f"{self.get_name()} is up, said {self.times} times")


def main():
    rclpy.init()
    node = Node04("node_04")
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # how a node is meant to end
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
