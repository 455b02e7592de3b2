#include <gtest/gtest.h>

#include "duet/io/bound_network.h"

namespace duet {
namespace {

TEST(Layout, SaysThePlaceOfEachEntryAndTheFramesOfEachBlock) {
  const std::vector<LayoutBlock> blocks = {
      {{{"gyro", 3}, {"height", 1}}, 1}, {{{"joints", 29}}, 5}, {{{"tick", 1}}, 2}};
  EXPECT_EQ(layout_text(blocks), "gyro 0..2, height 3; joints 4..32 (5 frames of 29); tick 149 (2 frames of 1)");
  EXPECT_EQ(layout_size(blocks), 4 + 145 + 2);
  EXPECT_EQ(blocks[0].frame_size(), 4);
}

TEST(Layout, OfNothingIsEmpty) {
  EXPECT_EQ(layout_text({}), "");
  EXPECT_EQ(layout_size({}), 0);
}

}  // namespace
}  // namespace duet
