#include <gtest/gtest.h>

#include "scan_msgs/points.hpp"

TEST(points, three_numbers_are_one) {
  scan_msgs::msg::Cloud cloud;
  cloud.points.resize(6);
  EXPECT_EQ(2u, scan_msgs::count(cloud));
}
