#include "late_lib/late.hpp"

int main()
{
  return late_lib::shout("hey") == "HEY2.4.1" ? 0 : 1;
}
