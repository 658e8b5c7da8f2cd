#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "late_lib/late.hpp"

TEST(late, shouts) {
  EXPECT_EQ("ABC2.4.1", late_lib::shout("abc"));
}

TEST(late, environment_arrives) {
  EXPECT_STREQ("", std::getenv("EMPTY_WORD"));
  EXPECT_STREQ("foo", std::getenv("PLAIN_WORD"));
  EXPECT_TRUE(std::ifstream(std::getenv("LATE_FILE")).good());
}
