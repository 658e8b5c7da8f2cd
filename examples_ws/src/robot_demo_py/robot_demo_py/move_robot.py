"""Move the robot there by the service and back by the action, as far as robot_configs says."""

from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from example_ros2_interfaces.msg import RobotStatus
from example_ros2_interfaces.srv import MoveRobot as MoveService
from robot_control_interfaces.action import MoveRobot as MoveAction

from robot_demo_py.robot import Robot


def main():
    settings = yaml.safe_load(
        Path(get_package_share_directory("robot_configs"), "config", "robot.yaml").read_text()
    )
    robot = Robot()

    request = MoveService.Request(distance=settings["service_distance"])
    response = robot.move(request)
    print(f"service: asked for {request.distance:.3f} m, stands at {response.pose:.3f} m")

    goal = MoveAction.Goal(distance=settings["action_distance"])
    print(f"action: goal {goal.distance:.3f} m {'accepted' if robot.accept(goal) else 'refused'}")
    while not robot.arrived:
        feedback = robot.step()
        print(f"  at {feedback.pose:.3f} m, status {feedback.status}")
    print(f"action: arrived at {robot.result().pose:.3f} m")

    status = robot.status()
    print("status:", "stopped" if status.status == RobotStatus.STATUS_STOPPED else "moving")
