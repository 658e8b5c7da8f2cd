// Ask the robot to move by five metres and follow it on its way.

#include <chrono>
#include <memory>

#include "example_ros2_interfaces/msg/robot_status.hpp"
#include "example_ros2_interfaces/srv/move_robot.hpp"
#include "rclcpp/rclcpp.hpp"

using namespace std::chrono_literals;
using example_ros2_interfaces::msg::RobotStatus;
using example_ros2_interfaces::srv::MoveRobot;

class ExampleInterfacesControl01 : public rclcpp::Node
{
public:
  using Client = rclcpp::Client<MoveRobot>;

  ExampleInterfacesControl01()
  : Node("example_interfaces_control_01")
  {
    client_ = create_client<MoveRobot>("move_robot");
    subscription_ = create_subscription<RobotStatus>(
      "robot_status", 10, [this](const RobotStatus & status) {follow(status);});
  }

  /// Wait until a robot is there; tell whether one came before Ctrl+C did.
  bool wait_for_robot()
  {
    while (!client_->wait_for_service(1s)) {
      if (!rclcpp::ok()) {
        return false;
      }
      RCLCPP_INFO(get_logger(), "waiting for a robot");
    }
    return true;
  }

  /// Ask the robot to move by a distance [m]; the answer comes in while this node spins.
  Client::FutureAndRequestId move(float distance)
  {
    RCLCPP_INFO(get_logger(), "asking to move by %.3f m", distance);
    const auto request = std::make_shared<MoveRobot::Request>();
    request->distance = distance;
    return client_->async_send_request(request);
  }

private:
  void follow(const RobotStatus & status)
  {
    const bool moving = status.status == RobotStatus::STATUS_MOVING;
    RCLCPP_INFO(get_logger(), "%s at %.3f m", moving ? "moving" : "stopped", status.pose);
  }

  Client::SharedPtr client_;
  rclcpp::Subscription<RobotStatus>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  const auto control = std::make_shared<ExampleInterfacesControl01>();
  if (!control->wait_for_robot()) {
    return 1;
  }
  auto answer = control->move(5.0F);
  if (rclcpp::spin_until_future_complete(control, answer) != rclcpp::FutureReturnCode::SUCCESS) {
    return 1;
  }
  RCLCPP_INFO(control->get_logger(), "the robot arrived at %.3f m", answer.get()->pose);
  rclcpp::shutdown();
  return 0;
}
