// Bounded sequences are vectors that refuse to grow too long.

#include <algorithm>
#include <cassert>
#include <stdexcept>
#include <vector>

#include "rosidl_runtime_cpp/bounded_vector.hpp"
#include "rover/msg/route.hpp"
#include "shape_msgs/msg/solid_primitive.hpp"

namespace bounding
{

template<typename Action>
bool refused(Action action)
{
  try {
    action();
  } catch (const std::length_error &) {
    return true;
  }
  return false;
}

void run()
{
  rover::msg::Route route;
  route.weights = {0.1f, 0.2f, 0.3f};
  route.weights.push_back(0.4f);
  assert(refused([&] {route.weights.push_back(0.5f);}));
  assert(refused([&] {route.weights.resize(5);}));
  assert(refused([&] {route.weights = {1, 2, 3, 4, 5};}));
  assert(route.weights.size() == 4 && route.weights.max_size() == 4);
  assert(*std::max_element(route.weights.begin(), route.weights.end()) == 0.4f);
  assert(route.weights.data()[0] == route.weights.front());

  route.detours.emplace_back();
  route.detours.resize(2);
  route.detours[1].name = "ford";
  assert(refused([&] {route.detours.emplace_back();}));
  std::size_t letters = 0;
  for (const auto & detour : route.detours) {
    letters += detour.name.size();
  }
  assert(letters == 11);

  const std::vector<float> other = {1.0f, 2.0f};
  route.weights.assign(other.begin(), other.end());
  assert(std::equal(other.begin(), other.end(), route.weights.begin(), route.weights.end()));

  shape_msgs::msg::SolidPrimitive box;
  box.type = shape_msgs::msg::SolidPrimitive::BOX;
  box.dimensions.resize(3);
  box.dimensions[shape_msgs::msg::SolidPrimitive::BOX_Y] = 2.0;
  rosidl_runtime_cpp::BoundedVector<double, 3> copy = box.dimensions;
  assert(copy == box.dimensions && copy[1] == 2.0);
}

}  // namespace bounding
