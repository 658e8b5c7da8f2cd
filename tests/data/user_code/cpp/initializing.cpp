// How much a constructor fills is said by MessageInitialization.

#include <cassert>
#include <memory>
#include <new>
#include <cstring>

#include "geometry_msgs/msg/pose.hpp"
#include "rosidl_runtime_cpp/message_initialization.hpp"
#include "rover/msg/route.hpp"

namespace initializing
{

using rosidl_runtime_cpp::MessageInitialization;

void run()
{
  const rover::msg::Route all;
  assert(all.weights.size() == 2 && all.weights[1] == 0.75f);
  assert(all.tags.size() == 1 && all.tags.front() == "new");
  assert(all.covariance[5] == 0.0 && !all.flags[2]);

  const rover::msg::Route zero(MessageInitialization::ZERO);
  assert(zero.kind == 0 && zero.weights.empty() && zero.tags.empty());

  const rover::msg::Waypoint same{MessageInitialization::ALL};
  assert(same == rover::msg::Waypoint());

  const geometry_msgs::msg::Pose pose;
  assert(pose.orientation.w == 1.0);
  const geometry_msgs::msg::Pose blank(MessageInitialization::ZERO);
  assert(blank.orientation.w == 0.0);

  // What is only taken over is built over memory that holds something else.
  alignas(rover::msg::Waypoint) unsigned char memory[sizeof(rover::msg::Waypoint)];
  std::memset(memory, 0x55, sizeof(memory));
  auto * defaults = new (memory) rover::msg::Waypoint(MessageInitialization::DEFAULTS_ONLY);
  assert(defaults->speed == 0.5 && defaults->name == "unnamed");
  defaults->~Waypoint_();

  rover::msg::Waypoint later(MessageInitialization::SKIP);
  later.speed = 1.0;
  assert(later.speed == 1.0 && later.name.empty());

  const std::allocator<void> allocator;
  auto shared = std::make_shared<rover::msg::Route>(allocator, MessageInitialization::ALL);
  assert(*shared == all);
}

}  // namespace initializing
