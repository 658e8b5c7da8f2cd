// Messages are values: compared, copied, swapped, moved and kept in containers.

#include <algorithm>
#include <cassert>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "geometry_msgs/msg/point.hpp"
#include "geometry_msgs/msg/pose_with_covariance.hpp"
#include "rover/msg/route.hpp"
#include "std_msgs/msg/string.hpp"

namespace comparing
{

using geometry_msgs::msg::Point;

void run()
{
  Point one, other;
  assert(one == other);
  other.x = 1.0;
  assert(one != other);
  std::swap(one, other);
  assert(one.x == 1.0 && other.x == 0.0);

  std::vector<Point> points = {one, other, one};
  assert(std::count(points.begin(), points.end(), one) == 2);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  std::sort(points.begin(), points.end(), [](const Point & a, const Point & b) {return a.x < b.x;});
  assert(points.front() == other);

  std::map<std::string, rover::msg::Waypoint> places;
  places["gate"].position = one;
  assert(places.at("gate").position == one);

  std::deque<rover::msg::Route> history;
  rover::msg::Route route;
  route.waypoints.resize(3);
  history.push_back(route);
  history.push_back(std::move(route));
  assert(history.front() == history.back());
  history.back().waypoints[2].name = "barn";
  assert(history.front() != history.back());

  geometry_msgs::msg::PoseWithCovariance sure;
  const auto copy = sure;
  sure.covariance[35] = 0.1;
  assert(copy != sure && copy.covariance.size() == 36);

  std::optional<std_msgs::msg::String> last;
  assert(!last);
  last.emplace().data = "text";
  assert(last->data == "text");
  std::variant<Point, std_msgs::msg::String> either = one;
  assert(std::get<Point>(either) == one);
}

}  // namespace comparing
