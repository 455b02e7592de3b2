#include <gmock/gmock.h>

#include "duet/io/observation.h"

namespace duet {
namespace {

using testing::ElementsAre;

// The history as it is shown after each frame (k, 10 k).
std::vector<std::vector<float>> shown(FrameHistory& history, int count) {
  std::vector<std::vector<float>> all;
  for (int k = 1; k <= count; ++k) {
    const float frame[] = {static_cast<float>(k), 10.0F * static_cast<float>(k)};
    all.emplace_back(history.size());
    history.add(frame, all.back());
  }
  return all;
}

TEST(FrameHistory, IsOldestFirstFromZeros) {
  FrameHistory history(2, {.frames = 3});
  EXPECT_EQ(history.size(), 6);
  EXPECT_THAT(shown(history, 4), ElementsAre(ElementsAre(0, 0, 0, 0, 1, 10), ElementsAre(0, 0, 1, 10, 2, 20),
                                             ElementsAre(1, 10, 2, 20, 3, 30), ElementsAre(2, 20, 3, 30, 4, 40)));
}

TEST(FrameHistory, MayBeginWithItsFirstFrameRepeated) {
  FrameHistory history(2, {.frames = 3, .starts_full = true});
  EXPECT_THAT(shown(history, 2), ElementsAre(ElementsAre(1, 10, 1, 10, 1, 10), ElementsAre(1, 10, 1, 10, 2, 20)));
}

TEST(FrameHistory, MayLeaveTheCurrentFrameOut) {
  FrameHistory history(2, {.frames = 2, .current = false});
  EXPECT_THAT(shown(history, 3),
              ElementsAre(ElementsAre(0, 0, 0, 0), ElementsAre(0, 0, 1, 10), ElementsAre(1, 10, 2, 20)));
  FrameHistory full(2, {.frames = 2, .current = false, .starts_full = true});
  EXPECT_THAT(shown(full, 2), ElementsAre(ElementsAre(1, 10, 1, 10), ElementsAre(1, 10, 1, 10)));
}

TEST(FrameHistory, StartsAgainAtAReset) {
  for (const bool full : {false, true}) {
    FrameHistory history(2, {.frames = 3, .starts_full = full});
    const auto first = shown(history, 3);
    history.reset();
    EXPECT_EQ(shown(history, 3), first);
  }
}

}  // namespace
}  // namespace duet
