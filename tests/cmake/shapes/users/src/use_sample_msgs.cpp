#include "sample_msgs/readings.hpp"

int main()
{
  return sample_reading().limits.high == 4.5 ? 0 : 1;
}
