// Print a RobotPose as YAML, or with --report as one line that the Python program prints alike.

#include <cstdio>
#include <iostream>
#include <string>

#include "example_ros2_interfaces/msg/robot_pose.hpp"

using example_ros2_interfaces::msg::RobotPose;

namespace
{

RobotPose example()
{
  RobotPose message;
  message.status = RobotPose::STATUS_MOVING;
  message.pose.position.x = 1.25;
  message.pose.position.y = -0.5;
  message.pose.position.z = 0.0;
  message.pose.orientation.z = 0.6;
  message.pose.orientation.w = 0.8;
  return message;
}

void report(const RobotPose & message)
{
  const auto & position = message.pose.position;
  const auto & orientation = message.pose.orientation;
  std::printf(
    "status %u, position (%.4f, %.4f, %.4f), orientation (%.4f, %.4f, %.4f, %.4f)\n",
    message.status, position.x, position.y, position.z,
    orientation.x, orientation.y, orientation.z, orientation.w);
}

}  // namespace

int main(int argc, char ** argv)
{
  const RobotPose message = example();
  if (argc > 1 && std::string(argv[1]) == "--report") {
    report(message);
  } else {
    std::cout << to_yaml(message);
  }
  return 0;
}
