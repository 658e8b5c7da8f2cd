#ifndef WALKER__GAIT_PLANNER_HPP_
#define WALKER__GAIT_PLANNER_HPP_

#include "walker/visibility_control.h"

namespace walker
{

class GaitPlanner
{
public:
  WALKER_PUBLIC
  GaitPlanner();

  WALKER_PUBLIC
  virtual ~GaitPlanner();
};

}  // namespace walker

#endif  // WALKER__GAIT_PLANNER_HPP_
