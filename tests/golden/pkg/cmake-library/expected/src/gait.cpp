#include "walker/gait.hpp"

namespace walker
{

Gait::Gait() = default;

Gait::~Gait() = default;

}  // namespace walker
