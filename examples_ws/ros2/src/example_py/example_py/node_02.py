"""The smallest node: it says hello and stays until Ctrl+C."""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


def main():
    rclpy.init()
    node = Node("node_02")
    node.get_logger().info("node_02 is up")
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # how a node is meant to end
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
