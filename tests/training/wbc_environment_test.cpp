#include "duet/training/wbc_environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/controllers/wbc_sim/observation.h"
#include "duet/core/numbers.h"
#include "duet/core/robot_state.h"
#include "duet/training/wbc_task.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using test::g1;

class WbcEnvironmentInMujoco : public test::InMujoco {};

TEST_F(WbcEnvironmentInMujoco, SizesAreTheSupplements) {
  const WbcEnvironment environment(g1(), wbc_stage("stand"), 1, 0);
  EXPECT_EQ(environment.actor_size(), 163);
  EXPECT_EQ(environment.critic_size(), 361);
  EXPECT_EQ(environment.actions(), 29);
}

TEST_F(WbcEnvironmentInMujoco, SeedAndIndexDecideEverything) {
  WbcTask task = wbc_stage("interact");
  task.stream.motions = 0.0;
  WbcEnvironment a(g1(), task, 1, 3), b(g1(), task, 1, 3), c(g1(), task, 1, 4);
  const std::vector<float> action(29, 0.1F);
  std::vector<float> oa(163), ob(163), oc(163), critic(361);
  for (int t = 0; t < 60; ++t) {
    const Transition ta = a.step(action), tb = b.step(action);
    c.step(action);
    ASSERT_EQ(ta.reward, tb.reward);
    if (ta.end != EpisodeEnd::kNone) {
      a.reset();
      b.reset();
      c.reset();
    }
  }
  a.observe(oa, critic);
  b.observe(ob, critic);
  c.observe(oc, critic);
  EXPECT_EQ(oa, ob);
  EXPECT_NE(oa, oc);
}

TEST_F(WbcEnvironmentInMujoco, WithoutAControllerItFallsWithinTwoSeconds) {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  const std::vector<float> nothing(29, 0.0F);
  Transition transition;
  while (transition.end == EpisodeEnd::kNone) transition = environment.step(nothing);
  EXPECT_EQ(transition.end, EpisodeEnd::kFell);
  EXPECT_LT(environment.tick(), 100);
  EXPECT_LT(transition.reward, -1.0);  // -100 per second over one tick, and what it had earned
}

TEST_F(WbcEnvironmentInMujoco, AnActionThatIsNotANumberIsNoAction) {
  WbcEnvironment environment(g1(), wbc_stage("stand"), 1, 0);
  const std::vector<float> action(29, std::nanf(""));
  const Transition transition = environment.step(action);
  EXPECT_TRUE(std::isfinite(transition.reward));
  EXPECT_EQ(environment.action().squaredNorm(), 0.0F);
}

TEST_F(WbcEnvironmentInMujoco, TimeEndsAnEpisodeOfFiveHundredTicks) {
  WbcEnvironment environment(g1(), wbc_stage("stand"), 1, 0);
  environment.skip_to(499);
  EXPECT_EQ(environment.step(std::vector<float>(29, 0.0F)).end, EpisodeEnd::kTimeUp);
}

TEST(WbcTask, AnUnknownStageIsRefusedWithTheKnownOnes) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { wbc_stage("run"); }));
}

TEST_F(WbcEnvironmentInMujoco, TimeIsUpAfterTheTicksOfTheTaskAndNoSooner) {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  task.episode_ticks = 5;
  WbcEnvironment environment(g1(), task, 1, 0);
  const std::vector<float> nothing(29, 0.0F);
  for (int tick = 1; tick < 5; ++tick) EXPECT_EQ(environment.step(nothing).end, EpisodeEnd::kNone) << tick;
  EXPECT_EQ(environment.step(nothing).end, EpisodeEnd::kTimeUp);
}

// Sums of magnitudes since they were taken last: none is below 0, and a robot that sways has some of each.
TEST(WbcTask, AFootThatSwingsTooLowCostsMoreThanOneTooHigh) {
  EXPECT_EQ(lift_cost(0.0), 0.0);
  EXPECT_DOUBLE_EQ(lift_cost(-0.05), 0.0025);
  EXPECT_DOUBLE_EQ(lift_cost(0.05), 0.3 * 0.0025);
}

TEST_F(WbcEnvironmentInMujoco, TrackingErrorsAreSumsOfMagnitudes) {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  const std::vector<float> action(29, 0.2F);
  for (int tick = 0; tick < 10; ++tick) environment.step(action);
  const TrackingStatistics sums = environment.take_statistics();
  for (const double sum : {sums.root_xy, sums.heading, sums.upper_body, sums.joints, sums.action_rate})
    EXPECT_GT(sum, 0.0);
  EXPECT_EQ(environment.take_statistics().joints, 0.0);
}

// A robot that sways, for which nothing is rewarded or costs but what the test adds.
WbcTask unrewarded() {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  RewardWeights& w = task.reward;
  for (double* weight : {&w.root_xy,  &w.root_near,   &w.upper_body,  &w.hands,       &w.joints,   &w.height,
                         &w.attitude, &w.velocity,    &w.clock,       &w.lift,        &w.foothold, &w.both_feet,
                         &w.stance,   &w.action_rate, &w.action_jerk, &w.action,      &w.torque,   &w.limits,
                         &w.slip,     &w.spin,        &w.joint_speed, &w.self_contact})
    *weight = 0.0;
  return task;
}

TEST_F(WbcEnvironmentInMujoco, ARewardFallsOffWithTheSquareOfTheErrorOverItsWidth) {
  WbcTask task = unrewarded();
  task.reward.root_xy = 2.0;
  task.reward.root_xy_width = 0.03;
  WbcEnvironment environment(g1(), task, 1, 0);
  for (int tick = 0; tick < 10; ++tick) {
    const double reward = environment.step(std::vector<float>(29, 0.2F)).reward;
    const double error = environment.take_statistics().root_xy;
    EXPECT_GT(error, 0.0);
    EXPECT_NEAR(reward, kTick * 2.0 * std::exp(-std::pow(error / 0.03, 2)), 1e-12);
  }
}

TEST_F(WbcEnvironmentInMujoco, TheErrorOfTheJointsIsTheirMean) {
  WbcTask task = unrewarded();
  task.reward.joints = 1.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  const double reward = environment.step(std::vector<float>(29, 0.2F)).reward;
  const double rms = task.reward.joints_width * std::sqrt(-std::log(reward / kTick));
  const double mean = environment.take_statistics().joints;
  EXPECT_LE(mean, rms * (1.0 + 1e-9));
  EXPECT_GE(mean, rms / std::sqrt(29.0));  // no fewer: one joint has all of it
}

// How far the robot is from its reference, mean over half a second [m].
double distance_when(const WbcTask& task) {
  WbcEnvironment environment(g1(), task, 1, 0);
  for (int tick = 0; tick < 25; ++tick) environment.step(std::vector<float>(29, 0.0F));
  const TrackingStatistics sums = environment.take_statistics();
  return sums.root_xy / static_cast<double>(sums.ticks);
}

TEST_F(WbcEnvironmentInMujoco, OnlyTheShareOfEpisodesAskedForIsPushed) {
  WbcTask task = unrewarded();
  task.domain.push = 300.0;
  task.domain.push_pause = 0.02;
  task.domain.push_share = 0.0;
  const double alone = distance_when(task);
  task.domain.push_share = 1.0;
  EXPECT_GT(distance_when(task), 3.0 * alone);
}

TEST_F(WbcEnvironmentInMujoco, AnEpisodeWithPushesHasNoKicks) {
  for (int index = 0; index < 30; ++index) {  // the first kick is drawn between 0.5 and 4 s
    WbcTask task = unrewarded();
    task.reward.root_xy = 1.0;
    task.domain.push = 1e-9;
    task.domain.kick_from = task.domain.kick_to = 0.1;
    WbcEnvironment still(g1(), task, 1, index);
    task.domain.kick = 5.0;
    WbcEnvironment kicked(g1(), task, 1, index);
    const std::vector<float> nothing(29, 0.0F);
    for (int tick = 0; tick < 45; ++tick) ASSERT_EQ(kicked.step(nothing).reward, still.step(nothing).reward) << tick;
  }
}

TEST_F(WbcEnvironmentInMujoco, AnEpisodeEndsWhereTheRobotIsTooFarFromItsReference) {
  for (const double farthest : {1.0, 0.005}) {
    WbcTask task = unrewarded();
    task.farthest = farthest;
    WbcEnvironment environment(g1(), task, 1, 0);
    EpisodeEnd end = EpisodeEnd::kNone;
    for (int tick = 0; tick < 20 && end == EpisodeEnd::kNone; ++tick)
      end = environment.step(std::vector<float>(29, 0.2F)).end;
    EXPECT_EQ(end, farthest < 0.1 ? EpisodeEnd::kFell : EpisodeEnd::kNone);
  }
}

TEST_F(WbcEnvironmentInMujoco, AReferenceThatJumpsDoesSoFiveTimesASecond) {
  WbcTask task = unrewarded();
  task.domain.jump = 0.2;
  task.domain.jump_share = 1.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  Eigen::Vector3d before = environment.sensors().root_error;
  for (int tick = 1; tick <= 30; ++tick) {
    environment.step(std::vector<float>(29, 0.0F));
    const double moved = (environment.sensors().root_error - before).norm();
    before = environment.sensors().root_error;
    EXPECT_EQ(moved > 0.03, tick % 10 == 0) << "tick " << tick << ": " << moved;
  }
}

TEST_F(WbcEnvironmentInMujoco, FeetThatSlipOnTheGroundCost) {
  WbcTask task = unrewarded();
  task.reward.slip = 1.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  double sum = 0.0;
  for (int tick = 0; tick < 10; ++tick) sum += environment.step(std::vector<float>(29, 0.2F)).reward;
  EXPECT_LT(sum, 0.0);
}

// The whole situation mirrored at the xz plane.
RobotState mirrored(const RobotState& state) {
  const Mirror joints = mirror_joints(*g1());
  RobotState other = state;
  const Eigen::Matrix3d M = Eigen::Vector3d(1, -1, 1).asDiagonal();
  other.X_WB.p = M * state.X_WB.p;
  other.X_WB.R = Eigen::Quaterniond(Eigen::Matrix3d(M * state.X_WB.R.toRotationMatrix() * M));
  other.v_WB = M * state.v_WB;
  other.w_WB_B = -(M * state.w_WB_B);
  for (int i = 0; i < g1()->dof(); ++i) {
    other.q[i] = static_cast<double>(joints.sign[i]) * state.q[joints.from[i]];
    other.v[i] = static_cast<double>(joints.sign[i]) * state.v[joints.from[i]];
  }
  return other;
}

RobotState some_state() {
  Random random(4, 4);
  RobotState state = g1()->standing_state();
  state.X_WB.p += Eigen::Vector3d(0.1, 0.2, -0.02);
  state.X_WB.R = yaw_rotation(0.3) * Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 0).normalized());
  for (int i = 0; i < 3; ++i) {
    state.v_WB[i] = random.normal();
    state.w_WB_B[i] = random.normal();
  }
  for (int i = 0; i < g1()->dof(); ++i) {
    state.q[i] += 0.1 * random.normal();
    state.v[i] = random.normal();
  }
  return state;
}

TEST(Mirror, TwiceIsTheIdentity) {
  for (const Mirror& mirror : {mirror_joints(*g1()), mirror_actor(*g1()), mirror_critic(*g1(), g1()->roles.bodies)}) {
    std::vector<float> x(mirror.size()), once(mirror.size()), twice(mirror.size());
    for (size_t i = 0; i < x.size(); ++i) x[i] = static_cast<float>(i) + 0.5F;
    mirror.apply(x, once);
    mirror.apply(once, twice);
    EXPECT_EQ(x, twice);
    EXPECT_NE(x, once);
  }
}

// The observation of the mirrored situation is the mirrored observation: computed from states, not from the table.
TEST(Mirror, ObservationsOfMirroredStatesAreMirroredObservations) {
  const RobotState state = some_state(), other = mirrored(state);
  RobotState reference_state = some_state();
  reference_state.X_WB.p = {0.0, -0.1, 0.74};
  reference_state.X_WB.R = yaw_rotation(-0.2) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  const RobotState other_reference = mirrored(reference_state);
  const std::vector<int> links = g1()->roles.bodies;
  const Mirror mirror = mirror_critic(*g1(), links);
  const auto observe = [&](const RobotState& robot, const RobotState& wanted) {
    WbcTracker tracker(g1());
    tracker.reset({wanted.X_WB, wanted.q});
    WbcSensors sensors;
    read_sensors(robot, tracker, sensors);
    Kinematics kinematics(*g1());
    kinematics.update(robot.X_WB, robot.q);
    std::vector<float> o(361);
    write_oracle(sensors, Eigen::VectorXf::Zero(29), {o.data(), 163});
    write_bodies(kinematics, tracker.root(), links, {o.data() + 163, 198});
    return o;
  };
  std::vector<float> expected(361);
  mirror.apply(observe(state, reference_state), expected);
  const std::vector<float> found = observe(other, other_reference);
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 2e-3) << i;
}

}  // namespace
}  // namespace duet
