#include "duet/hardware/log/run_report.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "duet/archives/mcap.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/log/guard_health.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/hardware/logged_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;
using test::LoggedTwin;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

TEST(GuardHealth, HasAgesOfWhatCameAndNoneOfWhatDidNot) {
  GuardedTwin robot;
  robot.start();
  robot.plans = false;
  robot.run_for(0.2);
  GuardHealth health;
  fill_health(robot.guard, health);
  EXPECT_EQ(health.state, SafetyState::kRun);
  EXPECT_TRUE(health.stands);
  EXPECT_EQ(health.state_age, 0.0);
  EXPECT_NEAR(health.planner_age, 0.2, 0.02 + 1e-9);
  EXPECT_TRUE(std::isnan(health.executor_age));
  EXPECT_TRUE(std::isnan(health.charge));  // nobody reports it
  EXPECT_EQ(health.states, robot.guard.status().states);
}

TEST(GuardHealth, AWindowKeepsTheOldestTheNearestAndTheHottest) {
  GuardHealth window, first, second;
  first.time = 1.0, first.state_age = 0.03, first.distance = 0.4, first.casing = 60.0, first.share = 0.2;
  second.time = 2.0, second.state_age = 0.01, second.distance = 0.9, second.casing = 50.0, second.share = 1.0;
  second.states = 7;
  widen(first, window);
  EXPECT_EQ(window.share, 0.2);
  widen(second, window);
  EXPECT_EQ(window.time, 2.0);
  EXPECT_EQ(window.state_age, 0.03);
  EXPECT_EQ(window.distance, 0.4);
  EXPECT_EQ(window.casing, 60.0);
  EXPECT_EQ(window.share, 0.2);
  EXPECT_EQ(window.states, 7);
  EXPECT_TRUE(std::isnan(window.person_age));
}

TEST(GuardHealth, IsReadAsItWasWritten) {
  HealthMessage message;
  message.health.state = SafetyState::kHold;
  message.health.cause = StopCause::kPlannerAge;
  message.health.stands = true;
  message.health.planner_age = 0.7;
  message.health.distance = 0.456;
  message.health.restarts = 3;
  message.health.network = {5, 0, 0, 0, 7};
  message.missing = "remote_age";
  message.tracking_joint = "left_elbow_joint";
  message.next = std::string(next_key(SafetyState::kHold, true));
  const HealthMessage again = parse_health(health_json(message).dump(), "status");
  EXPECT_EQ(health_json(again), health_json(message));
  EXPECT_TRUE(std::isnan(again.health.charge));
  const std::string text = health_text(again);
  EXPECT_THAT(text, HasSubstr("hold (planner_age), missing: remote_age"));
  EXPECT_THAT(text, HasSubstr("next: A with R1: run again; select: damp"));
  EXPECT_THAT(text, HasSubstr("planner 700 ms, person never"));
  EXPECT_THAT(text, HasSubstr("charge not known"));
  EXPECT_THAT(text, HasSubstr("person: 0.46 m away; "));
  EXPECT_EQ(again.health.network, message.health.network);
  EXPECT_THAT(text, HasSubstr("network: 5 taken, 7 refused: 7 forged (another key, or altered on its way)"));
}

TEST(GuardHealth, RefusesWhatIsNoHealth) {
  const auto refusal = [](const std::string& text) {
    return test::thrown_message<InputError>([&] { (void)parse_health(text, "status"); });
  };
  EXPECT_SENTENCE(refusal("{"));
  EXPECT_SENTENCE(refusal("[]"));
  nlohmann::json json = health_json({});
  json["state"] = "asleep";
  EXPECT_SENTENCE(refusal(json.dump()));
  json = health_json({});
  json["charge"] = "full";
  EXPECT_SENTENCE(refusal(json.dump()));
  json = health_json({});
  json.erase("restarts");
  EXPECT_SENTENCE(refusal(json.dump()));
  json = health_json({});
  for (const char* count : {"-1", "1e300", "18446744073709551615"}) {
    json["restarts"] = nlohmann::json::parse(count);
    EXPECT_SENTENCE(refusal(json.dump()));
  }
}

// Each state has a key, or says what is waited for; what the guard does with them is tested by the guard's own tests.
TEST(GuardHealth, EveryStateHasANextKey) {
  for (int state = 0; state < kSafetyStates; ++state)
    for (const bool stands : {false, true})
      EXPECT_FALSE(next_key(static_cast<SafetyState>(state), stands).empty()) << state;
  GuardedTwin robot;
  robot.hold_key(RemoteKey::kR1);
  robot.run_for(2.2);
  EXPECT_EQ(robot.state(), SafetyState::kReady);
  robot.guard.arm();
  robot.tick();
  EXPECT_THAT(std::string(next_key(robot.state(), false)), HasSubstr("start: stand up"));
  robot.hold_key(RemoteKey::kStart);
  robot.run_for(0.1);
  robot.drop_key(RemoteKey::kStart);
  robot.run_for(1.0);
  ASSERT_TRUE(robot.guard.status().input.stands);
  EXPECT_THAT(std::string(next_key(robot.state(), true)), HasSubstr("A with R1: run"));
  robot.hold_key(RemoteKey::kA);
  robot.run_for(0.1);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
}

// The log of a run as programs read it that nobody here wrote: Foxglove's packages for MCAP, CDR and message
// definitions, in Node.js. `npm ci` in viewer/ installs them; without them the test is not run.

constexpr const char* kViewer = DUET_SOURCE_DIR "/viewer";

bool packages_are_there() {
  for (const char* package : {"@mcap/core", "@foxglove/rosmsg", "@foxglove/rosmsg2-serialization", "fzstd"})
    if (!std::filesystem::exists(std::filesystem::path(kViewer) / "node_modules" / package)) return false;
  return std::system("command -v node >/dev/null 2>&1") == 0;
}

// Time [ns], 0 for a state and 1 for a command, 29 positions.
using Row = std::array<double, 2 + kG1Motors>;

template <typename Frame>
Row row_of(double now, double kind, const Frame& frame) {
  Row row{std::round(1e9 * now), kind};
  for (int j = 0; j < kG1Motors; ++j) row[2 + j] = static_cast<double>(frame.motor[j].q);
  return row;
}

// A run of 7 s with arms that move; what was read and sent.
std::vector<Row> run_and_log(const std::string& path) {
  std::vector<Row> rows;
  test::LoggedTwin run(path, test::twin_guard(), {.place_noise = 0.001, .joint_noise = 1e-3});
  const auto remember = [&] {
    const GuardStatus& status = run.robot.guard.status();
    rows.push_back(row_of(status.input.now, 0.0, status.state_frame));
    if (status.sent) rows.push_back(row_of(status.input.now, 1.0, status.frame));
  };
  run.arm(remember);
  run.robot.message.command.q.array() += 0.5;
  run.run_for(4.0, remember);
  EXPECT_EQ(run.log.dropped(), 0);
  return rows;
}

TEST(ForeignReader, FindsThePositionsThatWereWrittenAndSeeks) {
  if (!packages_are_there()) GTEST_SKIP() << "not run: npm packages absent (viewer/node_modules, by npm ci)";
  const test::ScratchFolder folder;
  const std::vector<Row> written = run_and_log(folder / "run.mcap");
  const std::string command = std::string("cd ") + kViewer + " && node read_log.mjs " + (folder / "run.mcap") + " " +
                              (folder / "q.bin") + " >" + (folder / "found.json") + " 2>" + (folder / "errors");
  ASSERT_EQ(std::system(command.c_str()), 0) << read_file(folder / "errors");

  const std::string bytes = read_file(folder / "q.bin");
  ASSERT_EQ(bytes.size(), written.size() * sizeof(Row));
  std::vector<Row> found(written.size());
  std::memcpy(found.data(), bytes.data(), bytes.size());
  EXPECT_EQ(found, written);  // to the bit
  const nlohmann::json json = nlohmann::json::parse(read_file(folder / "found.json"));
  EXPECT_EQ(json["topics"]["rt/lowstate"].get<std::size_t>() + json["topics"]["rt/lowcmd"].get<std::size_t>(),
            written.size());
  EXPECT_GE(json["chunks"].get<int>(), 3);
  const double seconds = 1e-9 * (written.back()[0] - written.front()[0]);
  EXPECT_NEAR(json["seconds"].get<double>(), seconds, 0.1);  // no message stands before the run's time
  EXPECT_NEAR(json["late"].get<double>(), 0.1 * seconds * 500.0, 5.0);
  EXPECT_LT(json["sought"].get<double>(), 0.6 * json["size"].get<double>());
  EXPECT_LT(json["opened"].get<double>(), 0.1 * json["size"].get<double>());
  EXPECT_EQ(json["health"]["state"], "run");
  const std::string elbow = test::g1()->joints[test::g1()->roles.arms[0][3]].name;
  EXPECT_NEAR(json["limiter"]["joints"][elbow]["asked"].get<double>(),
              test::g1()->neutral[test::g1()->roles.arms[0][3]] + 0.5, 1e-3);
}

}  // namespace
}  // namespace duet
