#include "part_tools/part_runner.hpp"

int main()
{
  return part_tools::run("no_such_part.so") == -1 ? 0 : 1;
}
