// Move the robot there by the service and back by the action.

#include <cstdio>

#include "robot_motion/robot.hpp"

using robot_motion::Robot;

int main()
{
  Robot robot;

  Robot::MoveService::Request request;
  request.distance = 2.0F;
  const auto response = robot.move(request);
  std::printf("service: asked for %.3f m, stands at %.3f m\n", request.distance, response.pose);

  Robot::MoveAction::Goal goal;
  goal.distance = -1.0F;
  std::printf("action: goal %.3f m %s\n", goal.distance, robot.accept(goal) ? "accepted" : "refused");
  while (!robot.arrived()) {
    const auto feedback = robot.step();
    std::printf("  at %.3f m, status %u\n", feedback.pose, feedback.status);
  }
  std::printf("action: arrived at %.3f m\n", robot.result().pose);

  const auto status = robot.status();
  std::printf("status: %s\n", status.status == Robot::Status::STATUS_STOPPED ? "stopped" : "moving");
  return 0;
}
