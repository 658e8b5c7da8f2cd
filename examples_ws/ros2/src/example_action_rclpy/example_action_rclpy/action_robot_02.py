"""A robot that accepts one goal at a time, reports its position on the way, and can be canceled."""

import time

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from robot_control_interfaces.action import MoveRobot

PERIOD = 0.5  # [s]
PRECISION = 0.01  # [m]
REACH = 100.0  # [m]


class ActionRobot02(Node):
    """A robot on a line: each step covers half of the remaining distance."""

    def __init__(self):
        super().__init__("action_robot_02")
        self.pose = 0.0
        self.busy = False
        self.server = ActionServer(
            self,
            MoveRobot,
            "move_robot",
            goal_callback=self.consider,
            cancel_callback=self.cancel,
            execute_callback=self.execute,
            # execute() takes a while: requests to cancel are handled in another thread.
            callback_group=ReentrantCallbackGroup(),
        )

    def consider(self, goal):
        if self.busy or abs(goal.distance) > REACH:
            self.get_logger().info(f"goal {goal.distance:.3f} m: rejected")
            return GoalResponse.REJECT
        self.get_logger().info(f"goal {goal.distance:.3f} m: accepted")
        self.busy = True
        return GoalResponse.ACCEPT

    def cancel(self, _goal):
        self.get_logger().info("asked to stop")
        return CancelResponse.ACCEPT

    def execute(self, goal):
        target = self.pose + goal.request.distance
        while abs(target - self.pose) > PRECISION and not goal.is_cancel_requested:
            self.pose += (target - self.pose) / 2
            goal.publish_feedback(MoveRobot.Feedback(pose=self.pose, status=MoveRobot.Feedback.STATUS_MOVING))
            time.sleep(PERIOD)
        self.busy = False
        if goal.is_cancel_requested:
            goal.canceled()
            self.get_logger().info(f"stopped at {self.pose:.3f} m")
        else:
            goal.succeed()
            self.get_logger().info(f"arrived at {self.pose:.3f} m")
        return MoveRobot.Result(pose=self.pose)


def main():
    rclpy.init()
    node = ActionRobot02()
    try:
        rclpy.spin(node, executor=MultiThreadedExecutor())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # Ctrl+C is the normal way to stop a node.
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
