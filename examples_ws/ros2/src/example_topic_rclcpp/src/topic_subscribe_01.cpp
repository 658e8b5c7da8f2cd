// Hear what /command says and tell how fast that would be.

#include <memory>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/string.hpp"

using std_msgs::msg::String;

namespace
{

/// Return the speed that a command means [m/s]; what we do not know had better stop the robot.
double speed_of(const std::string & command)
{
  if (command == "forward") {
    return 0.2;
  }
  return command == "backward" ? -0.2 : 0.0;
}

}  // namespace

class TopicSubscribe01 : public rclcpp::Node
{
public:
  TopicSubscribe01()
  : Node("topic_subscribe_01")
  {
    subscription_ = create_subscription<String>(
      "command", 10, [this](const String & command) {obey(command);});
  }

private:
  void obey(const String & command)
  {
    RCLCPP_INFO(
      get_logger(), "heard '%s': %.1f m/s", command.data.c_str(), speed_of(command.data));
  }

  rclcpp::Subscription<String>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<TopicSubscribe01>());
  rclcpp::shutdown();
  return 0;
}
