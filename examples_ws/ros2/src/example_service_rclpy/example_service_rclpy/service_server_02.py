"""Add two numbers for every client that asks."""

import rclpy
from example_interfaces.srv import AddTwoInts
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class ServiceServer02(Node):
    """A node with a service."""

    def __init__(self):
        super().__init__("service_server_02")
        self.service = self.create_service(AddTwoInts, "add_two_ints_srv", self.add)

    def add(self, request, response):
        response.sum = request.a + request.b
        self.get_logger().info(f"asked for {request.a} + {request.b}, answering {response.sum}")
        return response


def main():
    rclpy.init()
    node = ServiceServer02()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl+C is the normal way to stop a node.
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
