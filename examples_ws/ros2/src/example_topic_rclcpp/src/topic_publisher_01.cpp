// Tell a robot to go forward, twice a second, on the topic /command.

#include <chrono>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/string.hpp"

using namespace std::chrono_literals;
using std_msgs::msg::String;

class TopicPublisher01 : public rclcpp::Node
{
public:
  TopicPublisher01()
  : Node("topic_publisher_01")
  {
    // Ten commands wait for a subscriber that is slow; of more, the oldest are dropped.
    publisher_ = create_publisher<String>("command", 10);
    timer_ = create_wall_timer(500ms, [this] {publish();});
  }

private:
  void publish()
  {
    String command;
    command.data = "forward";
    RCLCPP_INFO(get_logger(), "publishing '%s'", command.data.c_str());
    publisher_->publish(command);
  }

  rclcpp::Publisher<String>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<TopicPublisher01>());
  rclcpp::shutdown();
  return 0;
}
