#include <gtest/gtest.h>

#include "text_tools/text_tools.h"

TEST(text, grows_up) {
  char text[] = TEXT_TOOLS_HELLO;
  text_tools_upper(text, sizeof(text) - 1);
  EXPECT_STREQ("HELLO", text);
}
