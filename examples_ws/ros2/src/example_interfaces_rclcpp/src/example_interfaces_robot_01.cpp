// A robot that moves when it is asked to, and tells twice a second how it stands.

#include <chrono>
#include <memory>
#include <vector>

#include "example_ros2_interfaces/msg/robot_status.hpp"
#include "example_ros2_interfaces/srv/move_robot.hpp"
#include "rclcpp/rclcpp.hpp"
#include "robot_motion/robot.hpp"

using namespace std::chrono_literals;
using example_ros2_interfaces::msg::RobotStatus;
using example_ros2_interfaces::srv::MoveRobot;
using robot_motion::Robot;

class ExampleInterfacesRobot01 : public rclcpp::Node
{
public:
  ExampleInterfacesRobot01()
  : Node("example_interfaces_robot_01")
  {
    publisher_ = create_publisher<RobotStatus>("robot_status", 10);
    service_ = create_service<MoveRobot>(
      "move_robot",
      [this](
        const std::shared_ptr<rmw_request_id_t> asker,
        const std::shared_ptr<MoveRobot::Request> request) {start(asker, *request);});
    timer_ = create_wall_timer(500ms, [this] {step();});
  }

private:
  /// Set out. The answer is due on arrival: to wait for that in here would stop the timer, and the robot.
  void start(const std::shared_ptr<rmw_request_id_t> & asker, const MoveRobot::Request & request)
  {
    RCLCPP_INFO(get_logger(), "asked to move by %.3f m", request.distance);
    Robot::MoveAction::Goal goal;
    goal.distance = request.distance;
    robot_.accept(goal);
    askers_.push_back(asker);
  }

  void step()
  {
    if (!robot_.arrived()) {
      robot_.step();
    }
    publisher_->publish(robot_.status());
    if (robot_.arrived()) {
      answer();
    }
  }

  void answer()
  {
    MoveRobot::Response response;
    response.pose = robot_.status().pose;
    for (const auto & asker : askers_) {
      RCLCPP_INFO(get_logger(), "arrived at %.3f m", response.pose);
      service_->send_response(*asker, response);
    }
    askers_.clear();
  }

  Robot robot_;
  std::vector<std::shared_ptr<rmw_request_id_t>> askers_;
  rclcpp::Publisher<RobotStatus>::SharedPtr publisher_;
  rclcpp::Service<MoveRobot>::SharedPtr service_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<ExampleInterfacesRobot01>());
  rclcpp::shutdown();
  return 0;
}
