// Demonstrations for D-STAR, made small.
#include "bench/demonstrations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/bench/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

DemonstrationOptions small_options() {
  DemonstrationOptions options;
  options.per_task = 3;
  options.starts = 2;
  options.followed = 1;
  options.engine = "playback";  // the robot is where it is told to be: nobody falls
  options.controller = "pd";
  options.threads = 2;
  return options;
}

DemonstrationSet made(const DemonstrationOptions& options) {
  Progress quiet(Progress::Style::kQuiet);
  return *make_demonstrations(test::g1(), options, quiet, [] { return false; });
}

std::map<std::string, int> takes_by_clip(const DemonstrationSet& set) {
  std::map<std::string, int> takes;
  for (const Demonstration& entry : set.list) ++takes[entry.clip_id];
  return takes;
}

TEST(MakeDemonstrations, EveryStartAsItIsAndTheFirstOfSomeClipsAsItIsFollowed) {
  const std::map<std::string, int> takes = takes_by_clip(made(small_options()));
  EXPECT_EQ(takes.size(), 18U);
  for (const auto& [clip, count] : takes) EXPECT_EQ(count, clip.ends_with("0000") ? 3 : 2) << clip;
}

TEST(MakeDemonstrations, AnotherPolicyIsSeenOnlyOnTheClipsThatAreFollowed) {
  DemonstrationOptions options = small_options();
  options.policy = "replay_dense";
  const DemonstrationSet set = made(options);
  EXPECT_THAT(takes_by_clip(set), ::testing::SizeIs(6));
  const DemonstrationSet own = made(small_options());
  EXPECT_EQ(set.list.front().digest, own.list.front().digest);
  // What was meant stays, whoever acted.
  EXPECT_EQ(set.wanted.col(10), own.wanted.col(10));
}

TEST(MakeDemonstrations, MoreThreadsAndMoreClipsChangeNoneOfThem) {
  DemonstrationOptions options = small_options();
  const DemonstrationSet first = made(options);
  options.threads = 1;
  options.per_task = 4;
  const DemonstrationSet second = made(options);
  ASSERT_EQ(first.list[1].clip_id, second.list[1].clip_id);
  const int frames = first.list[1].frames;
  EXPECT_EQ(first.observed.middleCols(first.list[1].begin, frames),
            second.observed.middleCols(second.list[1].begin, frames));
}

TEST(MakeDemonstrations, StoppedTheyAreNone) {
  Progress quiet(Progress::Style::kQuiet);
  EXPECT_FALSE(make_demonstrations(test::g1(), small_options(), quiet, [] { return true; }).has_value());
}

}  // namespace
}  // namespace duet
