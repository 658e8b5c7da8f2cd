// Publish a message twice a second, but only while the node is active.
//
// ros2 lifecycle set /lifecycle_talker_01 configure
// ros2 lifecycle set /lifecycle_talker_01 activate

#include <chrono>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"
#include "std_msgs/msg/string.hpp"

using namespace std::chrono_literals;
using rclcpp_lifecycle::State;
using std_msgs::msg::String;

/// A node whose resources exist only between configure and cleanup.
class LifecycleTalker01 : public rclcpp_lifecycle::LifecycleNode
{
public:
  LifecycleTalker01()
  : LifecycleNode("lifecycle_talker_01")
  {
  }

  CallbackReturn on_configure(const State &) override
  {
    publisher_ = create_publisher<String>("chatter", 10);
    timer_ = create_wall_timer(500ms, [this] {publish();});
    RCLCPP_INFO(get_logger(), "configured");
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_activate(const State & state) override
  {
    RCLCPP_INFO(get_logger(), "active");
    // The base class activates the publisher.
    return LifecycleNode::on_activate(state);
  }

  CallbackReturn on_deactivate(const State & state) override
  {
    RCLCPP_INFO(get_logger(), "inactive");
    return LifecycleNode::on_deactivate(state);
  }

  CallbackReturn on_cleanup(const State &) override
  {
    timer_.reset();
    publisher_.reset();
    RCLCPP_INFO(get_logger(), "cleaned up");
    return CallbackReturn::SUCCESS;
  }

private:
  void publish()
  {
    // A lifecycle publisher drops messages while the node is inactive.
    if (!publisher_->is_activated()) {
      return;
    }
    String message;
    message.data = "I am active";
    RCLCPP_INFO(get_logger(), "publishing");
    publisher_->publish(message);
  }

  rclcpp_lifecycle::LifecyclePublisher<String>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<LifecycleTalker01>()->get_node_base_interface());
  rclcpp::shutdown();
  return 0;
}
