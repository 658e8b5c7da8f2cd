#include "many_msgs/msg/number7.hpp"

int main()
{
  many_msgs::msg::Number7 number;
  return number.stamp.sec;
}
