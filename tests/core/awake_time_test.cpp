#include <gtest/gtest.h>

#include "duet/core/machine.h"

namespace duet {
namespace {

using std::chrono::milliseconds;

class AwakeTimeTest : public testing::Test {
 protected:
  [[nodiscard]] AwakeTime time() {
    return AwakeTime([this] { return now_; });
  }
  double now_ = 1e6;
};

TEST_F(AwakeTimeTest, AddsWhatPassesBetweenLooksButNoGapAboveASecond) {
  AwakeTime awake = time();
  EXPECT_EQ(awake.look(), 0.0);
  now_ += 0.5;
  EXPECT_EQ(awake.look(), 0.5);
  now_ += 3600.0;  // stopped
  EXPECT_EQ(awake.look(), 0.5);
  now_ += kLongestGap;
  EXPECT_EQ(awake.look(), 0.5 + kLongestGap);
}

TEST_F(AwakeTimeTest, LeavesOutWhatIsSkipped) {
  AwakeTime awake = time();
  now_ += 0.25;
  awake.skip();
  now_ += 0.5;
  EXPECT_EQ(awake.look(), 0.5);
}

TEST_F(AwakeTimeTest, ADeadlineIsRoundedUpAndPassesOnlyWhileTheProcessRuns) {
  AwakeDeadline deadline(milliseconds(250), time());
  EXPECT_EQ(deadline.left(), milliseconds(250));
  now_ += 0.0996;
  EXPECT_EQ(deadline.left(), milliseconds(151));
  now_ += 1000.0;
  EXPECT_FALSE(deadline.passed());
  now_ += 0.25;
  EXPECT_TRUE(deadline.passed());
  EXPECT_EQ(deadline.left(), milliseconds(0));
}

TEST_F(AwakeTimeTest, AThreadThatComputesIsCounted) {
  const double begin = thread_computed_seconds();
  while (thread_computed_seconds() - begin < 1e-3) continue;
  EXPECT_GT(monotonic_seconds(), 0.0);
}

}  // namespace
}  // namespace duet
