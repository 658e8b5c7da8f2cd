#ifndef PART_TOOLS__PART_RUNNER_HPP_
#define PART_TOOLS__PART_RUNNER_HPP_

#include <string>

namespace part_tools
{
int run(const std::string & library);
}

#endif  // PART_TOOLS__PART_RUNNER_HPP_
