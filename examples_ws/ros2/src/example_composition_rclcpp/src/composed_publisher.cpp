// A component that publishes twice a second.

#include <chrono>
#include <cinttypes>
#include <cstdint>
#include <memory>
#include <utility>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "std_msgs/msg/string.hpp"

using namespace std::chrono_literals;
using std_msgs::msg::String;

namespace example_composition
{

class ComposedPublisher : public rclcpp::Node
{
public:
  /// A component takes its options from the process that loads it.
  explicit ComposedPublisher(const rclcpp::NodeOptions & options)
  : Node("composed_publisher", options)
  {
    publisher_ = create_publisher<String>("composed", 10);
    timer_ = create_wall_timer(500ms, [this] {publish();});
  }

private:
  void publish()
  {
    auto message = std::make_unique<String>();
    message->data = "forward";
    RCLCPP_INFO(
      get_logger(), "publishing from 0x%" PRIxPTR, reinterpret_cast<std::uintptr_t>(message.get()));
    // With intra-process communication a unique pointer is handed over without a copy.
    publisher_->publish(std::move(message));
  }

  rclcpp::Publisher<String>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace example_composition

RCLCPP_COMPONENTS_REGISTER_NODE(example_composition::ComposedPublisher)
