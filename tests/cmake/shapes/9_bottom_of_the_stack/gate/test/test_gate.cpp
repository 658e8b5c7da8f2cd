#include <gmock/gmock.h>

#include "gate/gate.h"

TEST(gate, opens) {
  EXPECT_THAT(gate_open("hello"), ::testing::Eq(1));
}
