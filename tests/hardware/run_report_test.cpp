#include "duet/hardware/log/run_report.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/archives/mcap.h"
#include "duet/core/require.h"
#include "tests/hardware/logged_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;
using test::LoggedTwin;
using ::testing::ElementsAre;

// Armed, started, and run for a second.
void start(LoggedTwin& run) {
  run.arm();
  run.run_for(1.0);
  run.robot.drop_key(RemoteKey::kA);
}

TEST(RunReport, HasStatesAndWhyTheyChangedAndForHowLong) {
  const test::ScratchFolder folder;
  {
    LoggedTwin run(folder / "run.mcap");
    start(run);
    run.robot.plans = false;
    run.run_for(0.8);
    run.robot.hold_key(RemoteKey::kSelect);
    run.run_for(0.2);
  }
  const RunReport report = report_of_log(folder / "run.mcap");
  std::vector<std::string> states;
  double lasted = 0.0;
  for (const RunReport::Span& span : report.spans) {
    states.push_back(span.state + "/" + span.cause);
    lasted += span.seconds;
  }
  EXPECT_THAT(states, ElementsAre("listen/none", "ready/none", "armed/none", "stand/none", "run/none",
                                  "hold/planner_age", "damp/stop_key"));
  EXPECT_NEAR(lasted, report.seconds, 1e-6);
  EXPECT_NEAR(report.spans[5].seconds, 0.2, 0.03);  // 0.8 s of silence, held after 0.6
  EXPECT_TRUE(report.whole);
  EXPECT_TRUE(report.has_health);
  EXPECT_EQ(report.ticks, report.states);
  EXPECT_EQ(report.missed, 0);
  EXPECT_NEAR(static_cast<double>(report.commands) / report.commanded, 500.0, 5.0);
  EXPECT_NEAR(static_cast<double>(report.plans) / report.ran, 50.0, 25.0);  // none for the last 0.6 s
  ASSERT_EQ(std::string(report.ages[1].name), "planner");
  EXPECT_NEAR(report.ages[1].oldest.value, 0.8, 0.03);
  EXPECT_TRUE(std::isnan(report.nearest.value));  // this guard minds nobody
}

TEST(RunReport, SaysWhichJointTheLimiterChangedAndWhy) {
  const test::ScratchFolder folder;
  const int elbow = test::g1()->roles.arms[0][3];
  {
    LoggedTwin run(folder / "run.mcap");
    start(run);
    run.robot.message.command.q[elbow] += 0.6;
    run.run_for(1.0);
  }
  const RunReport report = report_of_log(folder / "run.mcap");
  const auto reason = static_cast<std::size_t>(ClampReason::kJointSpeed);
  EXPECT_GT(report.joints[elbow].changed[reason], 100);
  EXPECT_EQ(report.changed[reason], report.joints[elbow].changed[reason]);  // no other was too fast
  for (int joint = 0; joint < kG1Motors; ++joint) {
    if (joint == elbow) continue;
    EXPECT_EQ(report.joints[joint].changed[reason], 0) << joint;
  }
  EXPECT_GT(report.joints[elbow].largest, 0.01);
  EXPECT_GE(report.joints[elbow].largest, report.joints[elbow].rms);
  EXPECT_GT(report.followed, 400);
}

TEST(RunReport, HasFaultsWithTheirTimesAndStatesThatWereMissed) {
  const test::ScratchFolder folder;
  long dropped = 0;
  {
    LoggedTwin run(folder / "run.mcap");
    run.run_for(1.0);
    run.robot.spoil = [&](GuardedTwin::Frames& sent) {
      if (run.robot.ticks == 700) sent.front().crc ^= 1;
      if (run.robot.ticks == 800 || run.robot.ticks == 900) sent.clear(), ++dropped;
    };
    run.run_for(1.0);
  }
  const RunReport report = report_of_log(folder / "run.mcap");
  ASSERT_EQ(report.faults.size(), 1u);
  EXPECT_EQ(report.faults[0].name, "checksum_faults");
  EXPECT_EQ(report.faults[0].count, 1);
  EXPECT_NEAR(report.faults[0].first, 1.4, 0.03);
  EXPECT_EQ(dropped, 2);
  EXPECT_EQ(report.missed, 3);  // the one with the wrong checksum, too
  EXPECT_EQ(report.joints[0].hottest, 40.0);
}

TEST(RunReport, HasTheLeastDistanceOfThePerson) {
  const test::ScratchFolder folder;
  {
    LoggedTwin run(folder / "run.mcap", test::twin_guard(true));
    run.run_for(0.5);
    for (int k = 0; k < 20; ++k) {  // walks up to 2 m away
      run.robot.person.joints = test::standing_adult({4.0 - 0.1 * k, 0.0, 0.95});
      run.run_for(0.1);
    }
    run.robot.person.joints = test::standing_adult({2.5, 0.0, 0.95});
    run.run_for(0.5);
  }
  const RunReport report = report_of_log(folder / "run.mcap");
  EXPECT_GT(report.nearest.value, 1.4);  // of bodies, not of their middles
  EXPECT_LT(report.nearest.value, 2.1);
  EXPECT_NEAR(report.nearest.at, 2.45, 0.11);
}

TEST(RunReport, RefusesALogWithoutTicksAndWhatIsNoLog) {
  const test::ScratchFolder folder;
  { RunLog log(folder / "empty.mcap", test::twin_guard()); }
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)report_of_log(folder / "empty.mcap"); }));
  { McapWriter writer(folder / "other.mcap"); }
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)report_of_log(folder / "other.mcap"); }));
}

TEST(RunReport, ReadsALogOfBefore) {
  const RunReport report = report_of_log(DUET_SOURCE_DIR "/tests/fuzz/corpus/log_recording/sample0");
  EXPECT_EQ(report.ticks, 12);
  EXPECT_FALSE(report.has_health);
  EXPECT_EQ(report.states, 12);
}

}  // namespace
}  // namespace duet
