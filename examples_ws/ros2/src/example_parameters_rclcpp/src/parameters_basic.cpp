// Say something at each level, twice a second; the parameter rcl_log_level tells from which level on.
//
// Set it at the start, --ros-args -p rcl_log_level:=10 or --params-file FILE, or while the node runs:
// ros2 param set /parameters_basic rcl_log_level 40

#include <chrono>
#include <memory>

#include "rcl_interfaces/msg/integer_range.hpp"
#include "rcl_interfaces/msg/parameter_descriptor.hpp"
#include "rclcpp/rclcpp.hpp"

using namespace std::chrono_literals;
using Level = rclcpp::Logger::Level;

namespace
{

/// Describe the parameter to `ros2 param describe`; a value outside of the range is refused for us.
rcl_interfaces::msg::ParameterDescriptor descriptor()
{
  rcl_interfaces::msg::IntegerRange levels;
  levels.from_value = static_cast<int>(Level::Debug);
  levels.to_value = static_cast<int>(Level::Fatal);
  levels.step = 10;

  rcl_interfaces::msg::ParameterDescriptor descriptor;
  descriptor.description = "10 debug, 20 info, 30 warn, 40 error, 50 fatal: less is not logged";
  descriptor.integer_range.push_back(levels);
  return descriptor;
}

}  // namespace

class ParametersBasic : public rclcpp::Node
{
public:
  ParametersBasic()
  : Node("parameters_basic")
  {
    declare_parameter("rcl_log_level", static_cast<int>(Level::Info), descriptor());
    timer_ = create_wall_timer(500ms, [this] {log();});
  }

private:
  void log()
  {
    // Asked for anew each time: it may have been set since.
    const auto level = static_cast<Level>(get_parameter("rcl_log_level").as_int());
    get_logger().set_level(level);
    RCLCPP_DEBUG(get_logger(), "a debug message");
    RCLCPP_INFO(get_logger(), "an info message");
    RCLCPP_WARN(get_logger(), "a warning");
    RCLCPP_ERROR(get_logger(), "an error");
    RCLCPP_FATAL(get_logger(), "a fatal error");
  }

  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<ParametersBasic>());
  rclcpp::shutdown();
  return 0;
}
