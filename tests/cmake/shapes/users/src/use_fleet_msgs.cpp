#include "fleet_msgs/srv/send.hpp"

int main()
{
  fleet_msgs::srv::Send::Response response;
  return response.truck.state;
}
