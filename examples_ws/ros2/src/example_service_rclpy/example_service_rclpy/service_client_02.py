"""Ask a server to add the parameters a and b: 5 and 6, or --ros-args -p a:=20 -p b:=22."""

import rclpy
from example_interfaces.srv import AddTwoInts
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class ServiceClient02(Node):
    """A node that calls a service once."""

    def __init__(self):
        super().__init__("service_client_02")
        self.declare_parameter("a", 5)
        self.declare_parameter("b", 6)
        self.client = self.create_client(AddTwoInts, "add_two_ints_srv")

    def add(self):
        """Return the request and the future of its response, which arrives while this node spins."""
        while not self.client.wait_for_service(timeout_sec=1.0):
            self.get_logger().info("waiting for a server")
        request = AddTwoInts.Request(
            a=self.get_parameter("a").value,
            b=self.get_parameter("b").value,
        )
        return request, self.client.call_async(request)


def main():
    rclpy.init()
    node = ServiceClient02()
    try:
        request, response = node.add()
        rclpy.spin_until_future_complete(node, response)
        node.get_logger().info(f"{request.a} + {request.b} = {response.result().sum}")
    except (KeyboardInterrupt, ExternalShutdownException):
        return 1
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
