#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "duet/policies/dstar/dstar_policy.h"
#include "duet/policies/policy.h"
#include "tests/support.h"

namespace duet {
namespace {

// A frame that says when it was seen.
ObservationFrame frame_at(int tick) {
  ObservationFrame frame;
  frame.partner.setConstant(tick);
  return frame;
}

std::vector<int> ticks_of(PastFrames& past) {
  std::vector<int> ticks;
  for (const ObservationFrame& frame : past.frames()) ticks.push_back(static_cast<int>(frame.partner(0, 0)));
  return ticks;
}

// The ticks that are looked back on at `tick`, with an observation every `every` ticks from 0.
std::vector<int> seen_at(int tick, int stride, int every) {
  PastFrames past(stride);
  ObservationHistory history;
  for (int t = 0; t <= tick; ++t) {
    history.add(frame_at(t));
    if (t % every == 0) past.add(history.at(t));
  }
  return ticks_of(past);
}

using ::testing::ElementsAre;

TEST(PastFrames, AreTheStrideApart) {
  EXPECT_THAT(seen_at(300, 20, 10), ElementsAre(80, 100, 120, 140, 160, 180, 200, 220, 240, 260, 280, 300));
  EXPECT_THAT(seen_at(300, 7, 10), ElementsAre(223, 230, 237, 244, 251, 258, 265, 272, 279, 286, 293, 300));
  EXPECT_THAT(seen_at(300, 1, 10), ElementsAre(289, 290, 291, 292, 293, 294, 295, 296, 297, 298, 299, 300));
}

TEST(PastFrames, BeforeTheFirstAreTheFirst) {
  EXPECT_THAT(seen_at(40, 20, 10), ElementsAre(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 20, 40));
}

TEST(PastFrames, OfTicksNotSeenAreTheLastOnesBefore) {
  // Observations at 0, 50, 100 bring the ticks 0, 39 to 50 and 89 to 100.
  EXPECT_THAT(seen_at(100, 8, 50), ElementsAre(0, 0, 0, 0, 44, 50, 50, 50, 50, 50, 92, 100));
}

TEST(PastFrames, AnObservationReplacesWhatWasSeenOfItsTicks) {
  PastFrames past(1);
  ObservationHistory history;
  history.add(frame_at(3));
  past.add(history.at(5));
  history.reset();
  history.add(frame_at(4));
  past.add(history.at(5));
  EXPECT_THAT(ticks_of(past), ::testing::Each(4));
  past.reset();
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { past.frames(); }));
}

}  // namespace
}  // namespace duet
