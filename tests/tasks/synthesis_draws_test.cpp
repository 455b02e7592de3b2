#include <gtest/gtest.h>

#include "duet/tasks/synthesis/act.h"

namespace duet::synthesis {
namespace {

TEST(SynthesisDraws, SpreadGoesThroughItsDeciles) {
  const Deciles deciles{.low = 1.0, .middle = 2.0, .high = 6.0};
  for (int index = 0; index < 500; ++index) {
    Draws draws(7, Task::kHug, index);
    const double u = draws.stream("distance").uniform(), value = draws.spread("distance", deciles);
    EXPECT_EQ(value <= deciles.low, u <= 0.1) << u;
    EXPECT_EQ(value <= deciles.middle, u <= 0.5) << u;
    EXPECT_EQ(value <= deciles.high, u <= 0.9) << u;
    EXPECT_GE(value, deciles.low - 0.25) << u << ": a quarter of the last stretch at most";
    EXPECT_LE(value, deciles.high + 1.0) << u;
  }
}

TEST(SynthesisDraws, WhatFollowsTheStyleIsWithinAFifthOfTheRange) {
  for (int index = 0; index < 100; ++index)
    for (const double style : {0.0, 0.3, 1.0}) {
      Draws draws(7, Task::kHug, index);
      const double share = (draws.styled("speed", style, 2.0, 4.0) - 2.0) / 2.0;
      EXPECT_NEAR(share, style, 0.2 + 1e-12);
      EXPECT_GE(share, 0.0);
      EXPECT_LE(share, 1.0);
    }
}

}  // namespace
}  // namespace duet::synthesis
