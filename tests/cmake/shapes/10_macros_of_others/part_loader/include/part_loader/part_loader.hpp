#ifndef PART_LOADER__PART_LOADER_HPP_
#define PART_LOADER__PART_LOADER_HPP_

#include <string>

namespace part_loader
{
int call(const std::string & library, const std::string & function);
}

#endif  // PART_LOADER__PART_LOADER_HPP_
