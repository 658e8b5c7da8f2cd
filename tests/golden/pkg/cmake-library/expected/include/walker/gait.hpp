#ifndef WALKER__GAIT_HPP_
#define WALKER__GAIT_HPP_

#include "walker/visibility_control.h"

namespace walker
{

class Gait
{
public:
  WALKER_PUBLIC
  Gait();

  WALKER_PUBLIC
  virtual ~Gait();
};

}  // namespace walker

#endif  // WALKER__GAIT_HPP_
