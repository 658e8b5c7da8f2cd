// Constants in switches, in constant expressions, by reference, and in arrays.

#include <algorithm>
#include <array>
#include <cassert>
#include <string>

#include "action_msgs/msg/goal_status.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "rover/msg/route.hpp"
#include "sensor_msgs/msg/nav_sat_status.hpp"
#include "sensor_msgs/msg/point_field.hpp"

namespace switching
{

using rover::msg::Route;

std::string describe(const Route & route)
{
  switch (route.kind) {
    case Route::OPEN:
      return "there";
    case Route::CLOSED:
      return "there and back";
    default:
      return "somewhere";
  }
}

std::size_t bytes_of(uint8_t datatype)
{
  using sensor_msgs::msg::PointField;
  switch (datatype) {
    case PointField::INT8:
    case PointField::UINT8:
      return 1;
    case PointField::INT16:
    case PointField::UINT16:
      return 2;
    case PointField::FLOAT64:
      return 8;
    default:
      return 4;
  }
}

static_assert(Route::CLOSED == 1);
static_assert(sensor_msgs::msg::NavSatStatus::STATUS_NO_FIX < 0);

void run()
{
  Route route;
  assert(describe(route) == "there");
  route.kind = Route::CLOSED;
  assert(describe(route) == "there and back");
  route.header.frame_id = Route::FRAME;
  assert(route.header.frame_id == "map");
  assert(bytes_of(sensor_msgs::msg::PointField::FLOAT32) == 4);

  using diagnostic_msgs::msg::DiagnosticStatus;
  diagnostic_msgs::msg::DiagnosticArray report;
  report.status.resize(2);
  report.status[0].level = DiagnosticStatus::WARN;
  unsigned char worst = DiagnosticStatus::OK;
  for (const auto & status : report.status) {
    worst = std::max(worst, status.level);
  }
  assert(worst == DiagnosticStatus::WARN);
  const unsigned char & by_reference = std::max(DiagnosticStatus::OK, DiagnosticStatus::ERROR);
  assert(by_reference == 2);

  using action_msgs::msg::GoalStatus;
  constexpr std::array<int8_t, 3> ends = {
    GoalStatus::STATUS_SUCCEEDED, GoalStatus::STATUS_CANCELED, GoalStatus::STATUS_ABORTED};
  assert(std::count(ends.begin(), ends.end(), GoalStatus::STATUS_ABORTED) == 1);
}

}  // namespace switching
