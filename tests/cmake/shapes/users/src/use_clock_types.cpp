#include "clock_types/msg/stamp.hpp"

int main()
{
  clock_types::msg::Stamp stamp;
  return stamp.sec;
}
