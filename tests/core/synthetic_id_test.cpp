#include "duet/core/synthetic_id.h"

#include <gtest/gtest.h>

namespace duet {
namespace {

TEST(SyntheticId, NamesWhatTheClipWasDrawnFrom) {
  EXPECT_EQ(synthetic_clip_id("people", "high_five", 42, 7), "people-high_five-s42-0007");
  EXPECT_EQ(synthetic_clip_id("synth", "hug", 0, 12345), "synth-hug-s0-12345");
}

TEST(SyntheticId, IsKnownWithWhatFollowsIt) {
  for (const char* id : {"people-high_five-s42-0007", "synth-hug-s0-12345", "synth-hug-s0-0001-left_low",
                         "people-handshake-s20000-0003-tracked-A"})
    EXPECT_TRUE(is_synthetic_clip(id)) << id;
}

TEST(SyntheticId, OfRecordingsIsNone) {
  for (const char* id :
       {"sbu-s01s02-hugging-001", "", "people", "people-handshake", "synth-hug-s-0001", "synth-hug-42-0001",
        "synth-hug-s42-", "synth-hug-s42-one", "mine-hug-s42-0001", "people--s42-0001"})
    EXPECT_FALSE(is_synthetic_clip(id)) << id;
}

}  // namespace
}  // namespace duet
