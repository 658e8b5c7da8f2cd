"""Send a robot a goal and follow it; after the seconds of the parameter patience, cancel the goal."""

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from robot_control_interfaces.action import MoveRobot


class ActionControl02(Node):
    """A node that sends one goal."""

    def __init__(self):
        super().__init__("action_control_02")
        self.declare_parameter("distance", 10.0)
        self.declare_parameter("patience", 0.0)  # [s]; 0: wait until the robot arrives
        self.client = ActionClient(self, MoveRobot, "move_robot")

    def send_goal(self):
        """Return the future of the robot's answer, a goal handle."""
        while not self.client.wait_for_server(timeout_sec=1.0):
            self.get_logger().info("waiting for a robot")
        goal = MoveRobot.Goal(distance=self.get_parameter("distance").value)
        self.get_logger().info(f"goal: {goal.distance:.3f} m")
        return self.client.send_goal_async(goal, feedback_callback=self.follow)

    def follow(self, feedback):
        self.get_logger().info(f"at {feedback.feedback.pose:.3f} m")

    def wait_for_result(self, goal):
        """Return the robot's result; when patience runs out, request that it stops first."""
        result = goal.get_result_async()
        patience = self.get_parameter("patience").value
        if patience:
            rclpy.spin_until_future_complete(self, result, timeout_sec=patience)
            if not result.done():
                self.get_logger().info("that takes too long: canceling")
                goal.cancel_goal_async()
        rclpy.spin_until_future_complete(self, result)
        return result.result().result

    def run(self):
        answer = self.send_goal()
        rclpy.spin_until_future_complete(self, answer)
        goal = answer.result()
        if not goal.accepted:
            self.get_logger().error("rejected")
            return 1
        self.get_logger().info("accepted")
        result = self.wait_for_result(goal)
        self.get_logger().info(f"the robot is at {result.pose:.3f} m")
        return 0


def main():
    rclpy.init()
    node = ActionControl02()
    try:
        return node.run()
    except (KeyboardInterrupt, ExternalShutdownException):
        return 1
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
