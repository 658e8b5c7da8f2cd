// Messages made by their builders, every field named, and by chains of setters.

#include <cassert>
#include <string>

#include "builtin_interfaces/msg/time.hpp"
#include "geometry_msgs/msg/point.hpp"
#include "geometry_msgs/msg/pose.hpp"
#include "geometry_msgs/msg/pose_stamped.hpp"
#include "geometry_msgs/msg/quaternion.hpp"
#include "geometry_msgs/msg/twist.hpp"
#include "rover/msg/waypoint.hpp"
#include "std_msgs/msg/color_rgba.hpp"
#include "std_msgs/msg/empty.hpp"
#include "std_msgs/msg/header.hpp"

namespace building
{

geometry_msgs::msg::PoseStamped goal(double x, double y)
{
  using geometry_msgs::msg::Point;
  using geometry_msgs::msg::Pose;
  using geometry_msgs::msg::Quaternion;
  return geometry_msgs::build<geometry_msgs::msg::PoseStamped>()
         .header(std_msgs::build<std_msgs::msg::Header>()
           .stamp(builtin_interfaces::build<builtin_interfaces::msg::Time>().sec(12).nanosec(500))
           .frame_id("map"))
         .pose(geometry_msgs::build<Pose>()
           .position(geometry_msgs::build<Point>().x(x).y(y).z(0.0))
           .orientation(geometry_msgs::build<Quaternion>().x(0).y(0).z(0).w(1)));
}

void run()
{
  const auto there = goal(1.0, 2.0);
  assert(there.header.stamp.sec == 12 && there.header.frame_id == "map");
  assert(there.pose.position.y == 2.0 && there.pose.orientation.w == 1.0);

  geometry_msgs::msg::Twist drive;
  drive.linear.set__x(0.2).set__y(0.1);
  drive.angular.z = -1.0;
  drive.linear.x *= 2;
  assert(drive.linear.x == 0.4 && drive.linear.y == 0.1 && drive.angular.z == -1.0);

  const auto color = std_msgs::msg::ColorRGBA().set__r(1.0f).set__a(0.5f);
  assert(color.r == 1.0f && color.g == 0.0f && color.a == 0.5f);

  const std::string name = "gate";
  auto waypoint = rover::msg::Waypoint().set__name(name).set__position(there.pose.position);
  assert(waypoint.name == "gate" && waypoint.position.x == 1.0 && waypoint.speed == 0.5);

  const auto nothing = std_msgs::build<std_msgs::msg::Empty>();
  assert(nothing == std_msgs::msg::Empty());
}

}  // namespace building
