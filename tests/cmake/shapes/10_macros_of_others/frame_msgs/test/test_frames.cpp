#include <gtest/gtest.h>

#include "frame_msgs/frames.hpp"

TEST(frames, seconds) {
  clock_types::msg::Stamp stamp;
  stamp.sec = 2;
  stamp.nanosec = 500000000;
  EXPECT_EQ(2.5, frame_msgs::seconds(stamp));
}
