#include <gtest/gtest.h>

#include "sample_msgs/action/sweep.h"
#include "sample_msgs/msg/reading.h"

TEST(support_c, messages_are_initialized) {
  sample_msgs__msg__Reading reading;
  ASSERT_TRUE(sample_msgs__msg__Reading__init(&reading));
  EXPECT_EQ(0.0, reading.limits.high);
  sample_msgs__msg__Reading__fini(&reading);
}
