#include "duet/core/machine.h"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <mutex>

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

constexpr InstructionSet kAll[] = {InstructionSet::kPortable, InstructionSet::kV2, InstructionSet::kV3,
                                   InstructionSet::kV4};

TEST(InstructionSet, WhoeverHasOneHasTheNarrowerOnes) {
  EXPECT_TRUE(runs_here(InstructionSet::kPortable));
  for (std::size_t i = 1; i < std::size(kAll); ++i)
    EXPECT_TRUE(!runs_here(kAll[i]) || runs_here(kAll[i - 1])) << to_string(kAll[i]);
}

TEST(InstructionSet, OnlyX86HasThoseOfX86) {
#if defined(__x86_64__)
  EXPECT_TRUE(runs_here(InstructionSet::kV2));
#else
  for (const InstructionSet set : {InstructionSet::kV2, InstructionSet::kV3, InstructionSet::kV4})
    EXPECT_FALSE(runs_here(set)) << to_string(set);
#endif
}

TEST(InstructionSet, NamesAreThoseOfTheCompilers) {
  EXPECT_EQ(to_string(InstructionSet::kPortable), "portable");
  EXPECT_EQ(to_string(InstructionSet::kV4), "x86-64-v4");
}

// Work that waits for a caller (a plan, another process) needs no core: each of the calls waits here until all are
// there.
TEST(ParallelForEach, MakesAsManyCallsAtOnceAsItIsAskedFor) {
  const int threads = 4 * default_threads();
  std::mutex mutex;
  std::condition_variable all;
  int there = 0, met = 0;
  parallel_for_each(threads, threads, [&](int) {
    std::unique_lock lock(mutex);
    ++there;
    all.notify_all();
    if (all.wait_for(lock, std::chrono::seconds(30), [&] { return there == threads; })) ++met;
  });
  EXPECT_EQ(met, threads);
}

}  // namespace
}  // namespace duet
