#ifndef FRAME_MSGS__FRAMES_HPP_
#define FRAME_MSGS__FRAMES_HPP_

#include "clock_types/msg/stamp.hpp"
#include "part_tools/part_runner.hpp"

namespace frame_msgs
{
inline double seconds(const clock_types::msg::Stamp & stamp)
{
  return stamp.sec + stamp.nanosec * 1e-9;
}
}  // namespace frame_msgs

#endif  // FRAME_MSGS__FRAMES_HPP_
