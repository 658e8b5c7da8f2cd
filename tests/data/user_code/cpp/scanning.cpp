// Sequences are vectors: algorithms, range loops, moves.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "nav_msgs/msg/path.hpp"
#include "sensor_msgs/msg/joint_state.hpp"
#include "sensor_msgs/msg/laser_scan.hpp"

namespace scanning
{

float nearest(const sensor_msgs::msg::LaserScan & scan)
{
  float best = std::numeric_limits<float>::infinity();
  for (const auto & range : scan.ranges) {
    if (range >= scan.range_min && range <= scan.range_max) {
      best = std::min(best, range);
    }
  }
  return best;
}

void run()
{
  sensor_msgs::msg::LaserScan scan;
  scan.range_min = 0.1f;
  scan.range_max = 10.0f;
  scan.ranges = {1.5f, 0.05f, 4.0f, std::numeric_limits<float>::quiet_NaN()};
  scan.ranges.push_back(2.5f);
  scan.intensities.resize(scan.ranges.size(), 1.0f);
  assert(nearest(scan) == 1.5f);
  assert(std::accumulate(scan.intensities.begin(), scan.intensities.end(), 0.0f) == 5.0f);
  scan.ranges.erase(
    std::remove_if(scan.ranges.begin(), scan.ranges.end(), [](float range) {return std::isnan(range);}),
    scan.ranges.end());
  assert(scan.ranges.size() == 4);

  sensor_msgs::msg::JointState state;
  state.name = {"left", "right"};
  state.position.assign({0.0, 0.5});
  const auto found = std::find(state.name.begin(), state.name.end(), "right");
  assert(state.position[static_cast<std::size_t>(found - state.name.begin())] == 0.5);

  std::vector<double> efforts(1000, 2.0);
  const double * before = efforts.data();
  state.effort = std::move(efforts);
  assert(state.effort.data() == before);

  nav_msgs::msg::Path path;
  for (int step = 0; step < 5; ++step) {
    path.poses.emplace_back();
    path.poses.back().pose.position.x = step;
  }
  std::reverse(path.poses.begin(), path.poses.end());
  assert(path.poses.front().pose.position.x == 4);
  auto moved = std::move(path);
  assert(moved.poses.size() == 5);
}

}  // namespace scanning
