// A node as a class: what a node owns, its publishers, timers and so on, becomes members of it.

#include <memory>
#include <string>

#include "rclcpp/rclcpp.hpp"

class Node03 : public rclcpp::Node
{
public:
  explicit Node03(const std::string & name)
  : Node(name)
  {
    // A name may have been remapped on the command line: get_name() knows.
    RCLCPP_INFO(get_logger(), "%s is up", get_name());
  }
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Node03>("node_03"));
  rclcpp::shutdown();
  return 0;
}
