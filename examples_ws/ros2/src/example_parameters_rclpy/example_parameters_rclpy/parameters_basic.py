"""Log a message of each level twice a second; the parameter rcl_log_level sets the lowest level that is shown.

Set it at the start, with --ros-args -p rcl_log_level:=10 or --params-file FILE, or while the node runs:
ros2 param set /parameters_basic rcl_log_level 40
"""

import rclpy
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.executors import ExternalShutdownException
from rclpy.logging import LoggingSeverity
from rclpy.node import Node

# Shown by `ros2 param describe`; rclpy itself rejects a value outside of the range.
DESCRIPTOR = ParameterDescriptor(
    description="10 debug, 20 info, 30 warn, 40 error, 50 fatal: lower levels are not logged",
    integer_range=[IntegerRange(from_value=10, to_value=50, step=10)],
)


class ParametersBasic(Node):
    """A node that is told about each change of its parameter."""

    def __init__(self):
        super().__init__("parameters_basic")
        level = self.declare_parameter("rcl_log_level", int(LoggingSeverity.INFO), DESCRIPTOR)
        self.get_logger().set_level(LoggingSeverity(level.value))
        self.add_on_set_parameters_callback(self.changed)
        self.timer = self.create_timer(0.5, self.log)

    def changed(self, parameters):
        """Apply a new level. A node that returns successful=False rejects the value."""
        for parameter in parameters:
            if parameter.name == "rcl_log_level":
                self.get_logger().set_level(LoggingSeverity(parameter.value))
        return SetParametersResult(successful=True)

    def log(self):
        self.get_logger().debug("a debug message")
        self.get_logger().info("an info message")
        self.get_logger().warning("a warning")
        self.get_logger().error("an error")
        self.get_logger().fatal("a fatal error")


def main():
    rclpy.init()
    node = ParametersBasic()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl+C is the normal way to stop a node.
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
