// Messages in unordered containers and in streams.

#include <cassert>
#include <memory_resource>
#include <sstream>
#include <string>
#include <unordered_map>
#include <unordered_set>

#ifdef WITH_FMT
#include <fmt/format.h>
#endif

#include "forge_cdr/hash.hpp"
#include "geometry_msgs/msg/point.hpp"
#include "probe/msg/nest.hpp"
#include "probe/msg/nothings.hpp"
#include "rosidl_runtime_cpp/format.hpp"
#include "sensor_msgs/msg/image.hpp"

using geometry_msgs::msg::Point;
using probe::msg::Nest;

template<typename Message, typename Change>
void check_hash(Change change)
{
  const forge_cdr::Hash hash;
  Message one, other;
  assert(hash(one) == hash(other));
  change(other);
  assert(!(one == other) && hash(one) != hash(other));
  change(one);
  assert(one == other && hash(one) == hash(other));
}

int main()
{
  std::unordered_set<Point, forge_cdr::Hash> points;
  points.insert(Point().set__x(1.0));
  points.insert(Point().set__x(1.0).set__y(-0.0));
  points.insert(Point().set__y(1.0));
  assert(points.size() == 2);

  check_hash<Nest>([](Nest & message) {message.one.pair[1] = "other";});
  check_hash<Nest>([](Nest & message) {message.fixed[1].flags = {true, true};});
  check_hash<Nest>([](Nest & message) {message.few.resize(1);});
  check_hash<Nest>([](Nest & message) {message.any.resize(2); message.any[1].wide = u"x";});
  check_hash<Nest>([](Nest & message) {message.nothing.resize(1);});
  check_hash<probe::msg::Nothings>([](probe::msg::Nothings & message) {message.several.resize(1);});
  check_hash<sensor_msgs::msg::Image>([](sensor_msgs::msg::Image & message) {message.data = {1, 2};});
  forge_cdr::Hash()(geometry_msgs::msg::Point_<std::pmr::polymorphic_allocator<char>>());

  using rosidl_runtime_cpp::operator<<;
  std::ostringstream out;
  out << "at " << Point().set__z(2.0) << " " << 7;
  assert(out.str() == "at {x: 0.00000, y: 0.00000, z: 2.00000} 7");

#if defined __cpp_concepts && __cplusplus >= 202002L
  std::unordered_map<Point, int> counts;
  ++counts[Point()];
  assert(counts.at(Point()) == 1);
  assert(std::hash<std::string>()("a") == std::hash<std::string>()("a"));
#endif
#ifdef __cpp_lib_format
  assert(std::format("{} {:.>4}", Point(), 7) == to_yaml(Point(), true) + " ...7");
  assert(std::format("{:>38}", Point()) == "  " + to_yaml(Point(), true));
#endif
#ifdef WITH_FMT
  assert(fmt::format("{:>38}", Point()) == "  " + to_yaml(Point(), true));
#endif
}
