#ifndef PLAIN_CMAKE_MATH__APPROACH_HPP_
#define PLAIN_CMAKE_MATH__APPROACH_HPP_

namespace plain_cmake_math
{

/// Return the point that lies `fraction` of the way from `current` to `target`.
double approach(double current, double target, double fraction);

/// Tell whether two values are nearer to each other than `tolerance`.
bool near(double left, double right, double tolerance);

}  // namespace plain_cmake_math

#endif  // PLAIN_CMAKE_MATH__APPROACH_HPP_
