// The smallest node: it says hello and stays until Ctrl+C.

#include <memory>

#include "rclcpp/rclcpp.hpp"

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  const auto node = std::make_shared<rclcpp::Node>("node_01");
  RCLCPP_INFO(node->get_logger(), "node_01 is up");
  rclcpp::spin(node);
  rclcpp::shutdown();
  return 0;
}
