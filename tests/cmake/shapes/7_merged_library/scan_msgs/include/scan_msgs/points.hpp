#ifndef SCAN_MSGS__POINTS_HPP_
#define SCAN_MSGS__POINTS_HPP_

#include <cstddef>

#include "scan_msgs/msg/cloud.hpp"

namespace scan_msgs
{
inline std::size_t count(const msg::Cloud & cloud)
{
  return cloud.points.size() / 3;
}
}  // namespace scan_msgs

#endif  // SCAN_MSGS__POINTS_HPP_
