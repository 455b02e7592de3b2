#include "duet/execution/blame.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/execution/injected_faults.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::Fault;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;

RestartInstant instant(int tick, int own, int other, int third) {
  RestartInstant made{.tick = tick, .engines = {}};
  made.engines["bullet"] = {.failed = own, .ran = 3, .refusal = {}};
  made.engines["dart"] = {.failed = other, .ran = 3, .refusal = {}};
  made.engines["mujoco"] = {.failed = third, .ran = 3, .refusal = {}};
  return made;
}

TEST(Culprit, OfAFailureThatComesBackEverywhereIsThePolicy) {
  EXPECT_EQ(culprit_of({instant(0, 3, 3, 3), instant(50, 3, 3, 3)}, "bullet"), Culprit::kPolicy);
  EXPECT_EQ(culprit_of({instant(0, 3, 2, 3)}, "bullet"), Culprit::kPolicy);
  EXPECT_EQ(culprit_of({instant(0, 1, 3, 3), instant(50, 3, 3, 3)}, "bullet"), Culprit::kPolicy);
}

TEST(Culprit, OfAFailureThatStaysInOneEngineIsItsSolver) {
  EXPECT_EQ(culprit_of({instant(0, 3, 0, 0), instant(50, 3, 3, 3)}, "bullet"), Culprit::kSolver);
  EXPECT_EQ(culprit_of({instant(0, 2, 1, 0)}, "bullet"), Culprit::kSolver);
}

// At no single state often enough, over all of them far more often: 5 of 15 against 1 of 30.
TEST(Culprit, IsTheSolverThatFailsMoreOftenThanTheOthersOverAllStates) {
  std::vector<RestartInstant> instants;
  for (const int tick : {0, 40, 60, 70, 80}) instants.push_back(instant(tick, 1, tick == 40 ? 1 : 0, 0));
  EXPECT_EQ(culprit_of(instants, "bullet"), Culprit::kSolver);
  instants.push_back(instant(90, 3, 3, 3));  // from where nobody can still succeed: says nothing
  EXPECT_EQ(culprit_of(instants, "bullet"), Culprit::kSolver);
  for (RestartInstant& one : instants) one.engines["dart"].failed = 1;
  EXPECT_EQ(culprit_of({instants.begin(), instants.end() - 1}, "bullet"), Culprit::kUnclear);
}

TEST(Culprit, IsUnclearWhereItDoesNotComeBackOrInSomeOfTheOthers) {
  EXPECT_EQ(culprit_of({instant(0, 0, 0, 0), instant(50, 1, 0, 0)}, "bullet"), Culprit::kUnclear);
  EXPECT_EQ(culprit_of({instant(0, 3, 3, 0)}, "bullet"), Culprit::kUnclear);
  // Only from where chance had brought the robot does it fail, everywhere.
  EXPECT_EQ(culprit_of({instant(0, 0, 0, 0), instant(50, 3, 3, 3)}, "bullet"), Culprit::kUnclear);
  EXPECT_EQ(culprit_of({}, "bullet"), Culprit::kUnclear);
}

// A robot that stands for so many frames.
Recording standing(const RobotModel& robot, int frames) {
  Recording recording;
  recording.robot.assign(static_cast<std::size_t>(frames), robot.standing_state(Pose{}));
  recording.reference.assign(static_cast<std::size_t>(frames), {Pose{}, robot.neutral});
  return recording;
}

TEST(FirstDivergence, NamesTheQuantityThatLeavesAllOthers) {
  const auto robot = test::g1();
  const Recording other = standing(*robot, 60);
  EXPECT_EQ(first_divergence(other, {other}, *robot, 0).quantity, "");
  Recording own = other;
  const int knee = robot->joint_index("left_knee_joint");
  for (std::size_t t = 30; t < 60; ++t) own.robot[t].q[knee] += 0.3;
  for (std::size_t t = 40; t < 60; ++t) own.robot[t].X_WB.p.z() -= 0.2;
  const FirstDivergence first = first_divergence(own, {other}, *robot, 0);
  EXPECT_EQ(first.quantity, "left_knee_joint");
  EXPECT_DOUBLE_EQ(first.seconds, 0.6);
  EXPECT_NEAR(first.own - first.nearest, 0.3, 1e-12);
  EXPECT_EQ(first_divergence(own, {other, own}, *robot, 0).quantity, "");  // one of the others does the same
  own = other;
  for (std::size_t t = 20; t < 60; ++t) own.reference[t].q[knee] += 0.3;
  EXPECT_EQ(first_divergence(own, {other}, *robot, 0).quantity, "plan of left_knee_joint");
}

// Two engines, few restarts: minutes of blame_faults in seconds.
class InjectedFault : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Progress quiet(Progress::Style::kQuiet);
    experiment_ = std::make_unique<Experiment>(parse_suite(test::fault_suite(1, "bullet"), "faults.yaml"));
    experiment_->prepare(2, quiet);
  }
  static void TearDownTestSuite() { experiment_.reset(); }
  void SetUp() override {
    for (const char* engine : {"bullet", "mujoco"})
      if (!is_available(engine)) GTEST_SKIP() << "not run: " << engine << " absent";
  }

  static Blame blame(Fault fault, std::vector<double> before = {}) {
    Progress quiet(Progress::Style::kQuiet);
    const EpisodeSpec spec = experiment_->at(0);
    return blame_episode(
        *experiment_, spec,
        with_fault({.engines = {"mujoco"}, .before = std::move(before), .jitters = 2, .threads = 2}, fault, spec),
        quiet);
  }

  static std::unique_ptr<Experiment> experiment_;
};
std::unique_ptr<Experiment> InjectedFault::experiment_;

TEST_F(InjectedFault, NoneIsFoundInACleanEpisode) {
  const Blame found = blame(Fault::kNone);
  EXPECT_EQ(found.culprit, Culprit::kNobody);
  EXPECT_TRUE(found.instants.empty());
  EXPECT_THAT(blame_text(found), HasSubstr("nothing to blame"));
}

TEST_F(InjectedFault, OfTheSolverIsTheSolvers) {
  const Blame found = blame(Fault::kDamping);
  EXPECT_EQ(found.culprit, Culprit::kSolver) << blame_text(found);
  EXPECT_NE(found.divergence.quantity, "");
  EXPECT_THAT(blame_text(found),
              AllOf(HasSubstr("it fails in bullet and not, or far less, in the others"), HasSubstr("First apart")));
}

TEST_F(InjectedFault, OfThePolicyIsThePolicysFromTheStartOn) {
  const Blame found = blame(Fault::kWrongSign, {1.0});
  EXPECT_EQ(found.culprit, Culprit::kPolicy) << blame_text(found);
  EXPECT_EQ(found.all_fail_from, 0.0);
  ASSERT_EQ(found.instants.size(), 2U);
  EXPECT_EQ(blame_json(found).at("culprit"), "policy");
}

TEST_F(InjectedFault, WhatCannotBeBlamedIsRefused) {
  Progress quiet(Progress::Style::kQuiet);
  const EpisodeSpec spec = experiment_->at(0);
  EXPECT_THAT(thrown_message<MissingError>([&] { blame_episode(*experiment_, spec, {.engines = {"bulet"}}, quiet); }),
              HasSubstr("'bullet'"));
  EXPECT_THAT(
      thrown_message<std::invalid_argument>([&] { blame_episode(*experiment_, spec, {.engines = {"bullet"}}, quiet); }),
      HasSubstr("expected an engine beside the episode's own"));
  EpisodeSpec playback = spec;
  playback.engine = kPlaybackEngine;
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { blame_episode(*experiment_, playback, {}, quiet); }),
              HasSubstr("found one of playback"));
}

// From the recorded state, without a jitter and in its own engine, an episode goes on as it went.
TEST_F(InjectedFault, ARestartSeesWhatTheEpisodeSaw) {
  const EpisodeSpec spec = experiment_->at(0);
  const auto run = [&](const EpisodeRestart* restart) {
    RolloutSetup setup = experiment_->setup(spec);
    setup.restart = restart;
    const auto backend = make_backend("bullet", experiment_->scene(spec));
    return roll_out(setup, *backend, *Experiment::controller(spec), *spec.leader->make()).recording;
  };
  const Recording whole = run(nullptr);
  const int tick = whole.frames() / 2;
  const EpisodeRestart restart{whole.robot, tick, whole.robot[static_cast<std::size_t>(tick)]};
  const Recording again = run(&restart);
  ASSERT_EQ(again.frames(), whole.frames());
  for (int t = 0; t <= tick; ++t) {
    EXPECT_EQ(again.robot[t].q, whole.robot[t].q) << t;
    EXPECT_EQ(again.q_target[t], whole.q_target[t]) << t;  // the controller, too, is as it was
  }
  // Warm starts are gone: near, not equal.
  EXPECT_LT((again.robot[tick + 10].X_WB.p - whole.robot[tick + 10].X_WB.p).norm(), 0.005);
}

}  // namespace
}  // namespace duet
