#include "plain_cmake_math/approach.hpp"

#include <cmath>

namespace plain_cmake_math
{

double approach(double current, double target, double fraction)
{
  return current + fraction * (target - current);
}

bool near(double left, double right, double tolerance)
{
  return std::fabs(left - right) < tolerance;
}

}  // namespace plain_cmake_math
