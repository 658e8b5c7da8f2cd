// Ask a server to add the parameters a and b: 5 and 6, or --ros-args -p a:=20 -p b:=22.

#include <chrono>
#include <cinttypes>
#include <cstdint>
#include <memory>

#include "example_interfaces/srv/add_two_ints.hpp"
#include "rclcpp/rclcpp.hpp"

using namespace std::chrono_literals;
using example_interfaces::srv::AddTwoInts;

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  const auto node = std::make_shared<rclcpp::Node>("service_client_01");
  const auto client = node->create_client<AddTwoInts>("add_two_ints_srv");

  while (!client->wait_for_service(1s)) {
    if (!rclcpp::ok()) {
      RCLCPP_ERROR(node->get_logger(), "interrupted before a server was there");
      return 1;
    }
    RCLCPP_INFO(node->get_logger(), "waiting for a server");
  }

  const auto request = std::make_shared<AddTwoInts::Request>();
  request->a = node->declare_parameter<std::int64_t>("a", 5);
  request->b = node->declare_parameter<std::int64_t>("b", 6);

  // The answer comes in while the node spins: to wait for the future alone would last forever.
  auto answer = client->async_send_request(request);
  if (rclcpp::spin_until_future_complete(node, answer) != rclcpp::FutureReturnCode::SUCCESS) {
    RCLCPP_ERROR(node->get_logger(), "interrupted before the answer came");
    return 1;
  }
  RCLCPP_INFO(
    node->get_logger(), "%" PRId64 " + %" PRId64 " = %" PRId64,
    request->a, request->b, answer.get()->sum);
  rclcpp::shutdown();
  return 0;
}
