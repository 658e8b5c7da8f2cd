#include "walker/gait_planner.hpp"

namespace walker
{

GaitPlanner::GaitPlanner() = default;

GaitPlanner::~GaitPlanner() = default;

}  // namespace walker
