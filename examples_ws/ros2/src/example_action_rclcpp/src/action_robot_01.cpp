// A robot that takes on one goal at a time, reports on its way, and can be stopped.

#include <chrono>
#include <cmath>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "robot_control_interfaces/action/move_robot.hpp"
#include "robot_motion/robot.hpp"

using namespace std::chrono_literals;
using rclcpp_action::CancelResponse;
using rclcpp_action::GoalResponse;
using robot_control_interfaces::action::MoveRobot;

namespace
{
constexpr float kReach = 100.0F;  // [m]
}  // namespace

class ActionRobot01 : public rclcpp::Node
{
public:
  using GoalHandle = rclcpp_action::ServerGoalHandle<MoveRobot>;

  ActionRobot01()
  : Node("action_robot_01")
  {
    server_ = rclcpp_action::create_server<MoveRobot>(
      this, "move_robot",
      [this](const rclcpp_action::GoalUUID &, const std::shared_ptr<const MoveRobot::Goal> goal) {
        return consider(*goal);
      },
      [this](const std::shared_ptr<GoalHandle>) {
        RCLCPP_INFO(get_logger(), "asked to stop");
        return CancelResponse::ACCEPT;
      },
      [this](const std::shared_ptr<GoalHandle> goal) {start(goal);});
    timer_ = create_wall_timer(500ms, [this] {step();});
  }

private:
  GoalResponse consider(const MoveRobot::Goal & goal)
  {
    const bool reachable = std::abs(goal.distance) <= kReach;
    const bool accepted = reachable && !goal_;
    RCLCPP_INFO(
      get_logger(), "goal %.3f m: %s", goal.distance,
      accepted ? "accepted" : reachable ? "rejected, still busy" : "rejected, too far");
    return accepted ? GoalResponse::ACCEPT_AND_EXECUTE : GoalResponse::REJECT;
  }

  void start(const std::shared_ptr<GoalHandle> & goal)
  {
    goal_ = goal;
    robot_.accept(*goal->get_goal());
  }

  /// Go on towards the goal, if there is one. The timer does that, so that nothing here ever waits.
  void step()
  {
    if (!goal_) {
      return;
    }
    if (goal_->is_canceling()) {
      robot_.stop();
      goal_->canceled(std::make_shared<MoveRobot::Result>(robot_.result()));
      RCLCPP_INFO(get_logger(), "stopped at %.3f m", robot_.result().pose);
      goal_.reset();
      return;
    }
    goal_->publish_feedback(std::make_shared<MoveRobot::Feedback>(robot_.step()));
    if (robot_.arrived()) {
      goal_->succeed(std::make_shared<MoveRobot::Result>(robot_.result()));
      RCLCPP_INFO(get_logger(), "arrived at %.3f m", robot_.result().pose);
      goal_.reset();
    }
  }

  robot_motion::Robot robot_;
  std::shared_ptr<GoalHandle> goal_;  // null while there is nothing to do
  rclcpp_action::Server<MoveRobot>::SharedPtr server_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<ActionRobot01>());
  rclcpp::shutdown();
  return 0;
}
