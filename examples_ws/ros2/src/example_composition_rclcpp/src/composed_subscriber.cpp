// A component that logs where it received each message in memory.

#include <cinttypes>
#include <cstdint>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "std_msgs/msg/string.hpp"

using std_msgs::msg::String;

namespace example_composition
{

class ComposedSubscriber : public rclcpp::Node
{
public:
  explicit ComposedSubscriber(const rclcpp::NodeOptions & options)
  : Node("composed_subscriber", options)
  {
    subscription_ = create_subscription<String>(
      "composed", 10, [this](std::unique_ptr<String> message) {
        RCLCPP_INFO(
          get_logger(), "heard '%s' at 0x%" PRIxPTR, message->data.c_str(),
          reinterpret_cast<std::uintptr_t>(message.get()));
      });
  }

private:
  rclcpp::Subscription<String>::SharedPtr subscription_;
};

}  // namespace example_composition

RCLCPP_COMPONENTS_REGISTER_NODE(example_composition::ComposedSubscriber)
