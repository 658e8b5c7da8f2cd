// Send the robot a goal, the parameter distance in metres, and follow it until it is there.

#include <chrono>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "robot_control_interfaces/action/move_robot.hpp"

using namespace std::chrono_literals;
using robot_control_interfaces::action::MoveRobot;

class ActionControl01 : public rclcpp::Node
{
public:
  using Client = rclcpp_action::Client<MoveRobot>;
  using GoalHandle = rclcpp_action::ClientGoalHandle<MoveRobot>;

  ActionControl01()
  : Node("action_control_01")
  {
    client_ = rclcpp_action::create_client<MoveRobot>(this, "move_robot");
    declare_parameter("distance", 10.0);
    declare_parameter("patience", 0.0);  // [s]; 0: wait until the robot arrives
  }

  /// Wait until a robot is there; tell whether one came before Ctrl+C did.
  bool wait_for_robot()
  {
    while (!client_->wait_for_action_server(1s)) {
      if (!rclcpp::ok()) {
        return false;
      }
      RCLCPP_INFO(get_logger(), "waiting for a robot");
    }
    return true;
  }

  /// Send the goal. What the robot says of it comes in while this node spins, in this order.
  void send_goal()
  {
    Client::SendGoalOptions options;
    options.goal_response_callback = [this](const GoalHandle::SharedPtr & goal) {responded(goal);};
    options.feedback_callback =
      [this](const GoalHandle::SharedPtr &, const std::shared_ptr<const MoveRobot::Feedback> & feedback) {
        RCLCPP_INFO(get_logger(), "at %.3f m", feedback->pose);
      };
    options.result_callback = [this](const GoalHandle::WrappedResult & result) {ended(result);};

    MoveRobot::Goal goal;
    goal.distance = static_cast<float>(get_parameter("distance").as_double());
    RCLCPP_INFO(get_logger(), "goal: %.3f m", goal.distance);
    client_->async_send_goal(goal, options);
  }

  bool succeeded() const
  {
    return succeeded_;
  }

private:
  void responded(const GoalHandle::SharedPtr & goal)
  {
    if (goal) {
      RCLCPP_INFO(get_logger(), "accepted");
      cancel_after(std::chrono::duration<double>(get_parameter("patience").as_double()), goal);
    } else {
      RCLCPP_ERROR(get_logger(), "rejected");
      rclcpp::shutdown();  // nothing more will come: spin() in main() returns
    }
  }

  /// Cancel the goal when patience runs out; its result then says where the robot stopped.
  void cancel_after(std::chrono::duration<double> patience, const GoalHandle::SharedPtr & goal)
  {
    if (patience.count() <= 0.0) {
      return;
    }
    timer_ = create_wall_timer(
      patience, [this, goal] {
        timer_->cancel();  // once is enough
        RCLCPP_INFO(get_logger(), "that takes too long: canceling");
        client_->async_cancel_goal(goal);
      });
  }

  void ended(const GoalHandle::WrappedResult & result)
  {
    succeeded_ = result.code == rclcpp_action::ResultCode::SUCCEEDED;
    RCLCPP_INFO(
      get_logger(), "%s at %.3f m", succeeded_ ? "arrived" : "stopped early", result.result->pose);
    rclcpp::shutdown();
  }

  bool succeeded_ = false;
  Client::SharedPtr client_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  const auto control = std::make_shared<ActionControl01>();
  if (!control->wait_for_robot()) {
    return 1;
  }
  control->send_goal();
  rclcpp::spin(control);
  return control->succeeded() ? 0 : 1;
}
