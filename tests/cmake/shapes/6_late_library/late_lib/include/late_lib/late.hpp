#ifndef LATE_LIB__LATE_HPP_
#define LATE_LIB__LATE_HPP_

#include <string>

#include "text_tools/text_tools.h"

namespace late_lib
{
std::string shout(const std::string & text);
}

#endif  // LATE_LIB__LATE_HPP_
