#include "late_lib/late.hpp"

#include "late_lib/version.h"

namespace late_lib
{
std::string shout(const std::string & text)
{
  std::string loud = text;
  text_tools_upper(&loud[0], loud.size());
  return loud + LATE_LIB_VERSION_STR;
}
}  // namespace late_lib
