#include <gtest/gtest.h>

#include <type_traits>

#include "sample_msgs/action/sweep.hpp"

TEST(support_cpp, an_action_has_its_parts) {
  using Result = sample_msgs::action::Sweep::Result;
  EXPECT_TRUE((std::is_same<decltype(Result::best), sample_msgs::msg::Reading>::value));
}
