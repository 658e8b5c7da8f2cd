#include "scan_msgs/points.hpp"

int main()
{
  scan_msgs::msg::Cloud cloud;
  return static_cast<int>(scan_msgs::count(cloud));
}
