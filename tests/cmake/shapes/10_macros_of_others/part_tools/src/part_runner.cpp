#include "part_tools/part_runner.hpp"

#include "part_loader/part_loader.hpp"

namespace part_tools
{
int run(const std::string & library)
{
  return part_loader::call(library, "part_number");
}
}  // namespace part_tools
