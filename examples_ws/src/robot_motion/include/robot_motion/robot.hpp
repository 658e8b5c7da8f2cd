#ifndef ROBOT_MOTION__ROBOT_HPP_
#define ROBOT_MOTION__ROBOT_HPP_

#include "example_ros2_interfaces/msg/robot_pose.hpp"
#include "example_ros2_interfaces/msg/robot_status.hpp"
#include "example_ros2_interfaces/srv/move_robot.hpp"
#include "robot_control_interfaces/action/move_robot.hpp"

namespace robot_motion
{

/// A robot on a line: each step takes it half of the way that is left.
class Robot
{
public:
  using Pose = example_ros2_interfaces::msg::RobotPose;
  using Status = example_ros2_interfaces::msg::RobotStatus;
  using MoveService = example_ros2_interfaces::srv::MoveRobot;
  using MoveAction = robot_control_interfaces::action::MoveRobot;

  /// Serve a request: go all the way, then answer where that is.
  MoveService::Response move(const MoveService::Request & request);

  /// Take on a goal; tell whether there is anything to do.
  bool accept(const MoveAction::Goal & goal);

  /// Go one step towards the goal and tell how far that led.
  MoveAction::Feedback step();

  /// Give up the goal and stay where it led so far.
  void stop();

  /// Tell whether the goal is reached.
  bool arrived() const;

  /// Tell where the robot stands, as the result of an action.
  MoveAction::Result result() const;

  /// Tell where the robot stands, on its line.
  Status status() const;

  /// Tell where the robot stands, in space.
  Pose pose() const;

private:
  bool moving_ = false;
  float current_ = 0.0F;
  float target_ = 0.0F;
};

}  // namespace robot_motion

#endif  // ROBOT_MOTION__ROBOT_HPP_
