#include "robot_motion/robot.hpp"

#include "plain_cmake_math/approach.hpp"

namespace robot_motion
{

namespace
{
constexpr double kStride = 0.5;
constexpr double kTolerance = 0.01;
}  // namespace

Robot::MoveService::Response Robot::move(const MoveService::Request & request)
{
  MoveAction::Goal goal;
  goal.distance = request.distance;
  accept(goal);
  while (!arrived()) {
    step();
  }
  MoveService::Response response;
  response.pose = current_;
  return response;
}

bool Robot::accept(const MoveAction::Goal & goal)
{
  target_ += goal.distance;
  moving_ = !arrived();
  return moving_;
}

Robot::MoveAction::Feedback Robot::step()
{
  current_ = static_cast<float>(plain_cmake_math::approach(current_, target_, kStride));
  moving_ = !arrived();
  MoveAction::Feedback feedback;
  feedback.pose = current_;
  feedback.status = moving_ ? MoveAction::Feedback::STATUS_MOVING : MoveAction::Feedback::STATUS_STOPPED;
  return feedback;
}

void Robot::stop()
{
  target_ = current_;
  moving_ = false;
}

bool Robot::arrived() const
{
  return plain_cmake_math::near(current_, target_, kTolerance);
}

Robot::MoveAction::Result Robot::result() const
{
  MoveAction::Result result;
  result.pose = current_;
  return result;
}

Robot::Status Robot::status() const
{
  Status status;
  status.status = moving_ ? Status::STATUS_MOVING : Status::STATUS_STOPPED;
  status.pose = current_;
  return status;
}

Robot::Pose Robot::pose() const
{
  Pose pose;
  pose.status = moving_ ? Pose::STATUS_MOVING : Pose::STATUS_STOPPED;
  pose.pose.position.x = current_;
  pose.pose.orientation.w = 1.0;
  return pose;
}

}  // namespace robot_motion
