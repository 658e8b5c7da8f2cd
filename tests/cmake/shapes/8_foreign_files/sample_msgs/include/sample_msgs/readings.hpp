#ifndef SAMPLE_MSGS__READINGS_HPP_
#define SAMPLE_MSGS__READINGS_HPP_

#include "sample_msgs/msg/reading.hpp"

inline sample_msgs::msg::Reading sample_reading()
{
  sample_msgs::msg::Reading reading;
  reading.limits.high = 4.5;
  return reading;
}

#endif  // SAMPLE_MSGS__READINGS_HPP_
