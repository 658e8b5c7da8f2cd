// Messages as text, for logs and for people.

#include <cassert>
#include <sstream>
#include <string>

#include "geometry_msgs/msg/point_stamped.hpp"
#include "rover/msg/route.hpp"
#include "std_msgs/msg/empty.hpp"
#include "std_srvs/srv/set_bool.hpp"

namespace showing
{

std::ostream & operator<<(std::ostream & out, const geometry_msgs::msg::Point & point)
{
  to_flow_style_yaml(point, out);
  return out;
}

void run()
{
  geometry_msgs::msg::PointStamped message;
  message.header.frame_id = "map \"1\"";
  message.point.x = 0.5;
  assert(
    to_yaml(message) ==
    "header:\n"
    "  stamp:\n"
    "    sec: 0\n"
    "    nanosec: 0\n"
    "  frame_id: \"map \\\"1\\\"\"\n"
    "point:\n"
    "  x: 0.500000\n"
    "  y: 0.00000\n"
    "  z: 0.00000\n");
  assert(geometry_msgs::msg::to_yaml(message.point, true) == "{x: 0.500000, y: 0.00000, z: 0.00000}");
  std::ostringstream out;
  out << message.point;
  assert(out.str() == "{x: 0.500000, y: 0.00000, z: 0.00000}");

  std::ostringstream block;
  to_block_style_yaml(message.header.stamp, block, 4);
  assert(block.str() == "    sec: 0\n    nanosec: 0\n");

  rover::msg::Route route;
  route.sketch = {1, 255};
  const std::string text = to_yaml(route, true);
  assert(text.find("waypoints: []") != std::string::npos);
  assert(text.find("sketch: [1, 255]") != std::string::npos);
  assert(text.find("flags: [false, false, false]") != std::string::npos);
  assert(to_yaml(std_msgs::msg::Empty()) == "null\n");

  std_srvs::srv::SetBool::Request request;
  request.data = true;
  assert(to_yaml(request, true) == "{data: true}");
}

}  // namespace showing
