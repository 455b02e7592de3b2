#include <gtest/gtest.h>

#include "duet/core/names.h"

namespace duet {
namespace {

TEST(SyntheticId, NamesWhatTheClipWasDrawnFrom) {
  EXPECT_EQ(synthetic_clip_id("people", "high_five", 42, 7), "people-high_five-s42-0007");
  EXPECT_EQ(synthetic_clip_id("synth", "hug", 0, 12345), "synth-hug-s0-12345");
}

TEST(SyntheticId, AnotherRoleHasAnotherIdAndBackTheFirstOne) {
  for (const std::string id : {"wave-7", "A", "-A", "wave-A", "wave-B"})
    for (const char before : {'A', 'B'}) {
      const std::string other = id_in_other_role(id, before);
      EXPECT_NE(other, id);
      EXPECT_EQ(id_in_other_role(other, before == 'A' ? 'B' : 'A'), id) << id << " " << before;
    }
  EXPECT_EQ(id_in_other_role("wave-7", 'A'), "wave-7-B");
  EXPECT_EQ(id_in_other_role("wave-7-B", 'B'), "wave-7");
  EXPECT_EQ(tracked_clip_id("wave-7"), "wave-7-tracked");
}

}  // namespace
}  // namespace duet
