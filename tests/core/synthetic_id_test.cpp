#include "duet/core/synthetic_id.h"

#include <gtest/gtest.h>

namespace duet {
namespace {

TEST(SyntheticId, NamesWhatTheClipWasDrawnFrom) {
  EXPECT_EQ(synthetic_clip_id("people", "high_five", 42, 7), "people-high_five-s42-0007");
  EXPECT_EQ(synthetic_clip_id("synth", "hug", 0, 12345), "synth-hug-s0-12345");
}

}  // namespace
}  // namespace duet
