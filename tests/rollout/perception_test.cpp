#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/execution/runner.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rollout/act_episode.h"
#include "duet/rollout/perturbations/partner_perturbation.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "tests/backends/allocation_count.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Joints = Perception::Joints;

// A partner whose joints all stand at their index along x and move by one a tick along y.
Joints at_tick(int tick) {
  Joints joints = Joints::Zero();
  for (int j = 0; j < joints.cols(); ++j) joints.col(j) = Eigen::Vector3d(j, tick, 1.0);
  return joints;
}

// The partner as it is seen over so many ticks.
std::vector<Joints> watch(const PerceptionPlan& plan, int ticks, std::uint64_t seed = 5) {
  Perception perception(plan, seed);
  std::vector<Joints> seen;
  for (int t = 0; t < ticks; ++t) seen.push_back(perception.seen(t, at_tick(t)));
  return seen;
}

TEST(Perception, WithoutAPlanThePartnerIsSeenToTheBit) {
  const std::vector<Joints> seen = watch({}, 5);
  for (int t = 0; t < 5; ++t) EXPECT_EQ(seen[t], at_tick(t));
}

TEST(Perception, JitterHasItsDeviationAndNoMean) {
  PerceptionPlan plan;
  plan.jitter = 0.05;
  constexpr int kTicks = 200;
  const std::vector<Joints> seen = watch(plan, kTicks);
  double sum = 0.0, square = 0.0;
  for (int t = 0; t < kTicks; ++t) {
    sum += (seen[t] - at_tick(t)).sum();
    square += (seen[t] - at_tick(t)).squaredNorm();
  }
  const double n = kTicks * 72.0;
  EXPECT_NEAR(sum / n, 0.0, 4.0 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(square / n), 0.05, 4.0 * 0.05 / std::sqrt(2.0 * n));
}

TEST(Perception, ADroppedJointKeepsItsLastSeenPlace) {
  PerceptionPlan plan;
  plan.dropout = 0.3;
  constexpr int kTicks = 300;
  const std::vector<Joints> seen = watch(plan, kTicks);
  EXPECT_EQ(seen[0], at_tick(0));  // a first look there is
  int dropped = 0;
  for (int t = 1; t < kTicks; ++t) {
    for (int j = 0; j < 24; ++j) {
      if (seen[t].col(j) == at_tick(t).col(j)) continue;
      EXPECT_EQ(seen[t].col(j), seen[t - 1].col(j));
      ++dropped;
    }
  }
  const double n = 24.0 * (kTicks - 1);
  EXPECT_NEAR(dropped / n, 0.3, 4.0 * std::sqrt(0.3 * 0.7 / n));
}

TEST(Perception, LatencyShowsThePast) {
  PerceptionPlan plan;
  plan.latency_ms = 100.0;
  const std::vector<Joints> seen = watch(plan, 20);
  for (int t = 0; t < 20; ++t) EXPECT_EQ(seen[t], at_tick(std::max(0, t - 5))) << t;
}

TEST(Perception, AVanishedPartnerStaysWhereItWasLastSeen) {
  PerceptionPlan plan;
  plan.vanish = 0.2;
  plan.jitter = 0.01;
  const std::vector<Joints> seen = watch(plan, 30);
  EXPECT_NE(seen[9], seen[8]);
  for (int t = 10; t < 30; ++t) EXPECT_EQ(seen[t], seen[9]) << t;
}

TEST(Perception, AFreezeEnds) {
  PerceptionPlan plan;
  plan.freeze = PerceptionFreeze{0.2, 0.1};
  const std::vector<Joints> seen = watch(plan, 20);
  for (int t = 0; t < 20; ++t) EXPECT_EQ(seen[t], at_tick(t >= 10 && t < 15 ? 9 : t)) << t;
}

TEST(Perception, AJumpMovesEveryJointLevelByOneVector) {
  PerceptionPlan plan;
  plan.jump = PerceptionJump{0.2, 0.3};
  const std::vector<Joints> seen = watch(plan, 20);
  EXPECT_EQ(seen[9], at_tick(9));
  const Eigen::Vector3d jump = seen[10].col(0) - at_tick(10).col(0);
  constexpr double kRounding = 1e-13;
  EXPECT_NEAR(jump.norm(), 0.3, kRounding);
  EXPECT_EQ(jump.z(), 0.0);
  for (int t = 10; t < 20; ++t)
    for (int j = 0; j < 24; ++j) EXPECT_NEAR((seen[t].col(j) - at_tick(t).col(j) - jump).norm(), 0.0, kRounding);
  EXPECT_NE(watch(plan, 20, 6)[10], seen[10]);
}

TEST(Perception, TheSameSeedGivesTheSameView) {
  PerceptionPlan plan;
  plan.jitter = 0.02;
  plan.dropout = 0.1;
  EXPECT_EQ(watch(plan, 20), watch(plan, 20));
  EXPECT_NE(watch(plan, 20), watch(plan, 20, 6));
}

TEST(Perception, AllocatesNothingOnceItIsMade) {
  PerceptionPlan plan;
  plan.jitter = 0.02;
  plan.dropout = 0.1;
  plan.latency_ms = 200.0;
  plan.vanish = 0.5;
  Perception perception(plan, 1);
  const Joints joints = at_tick(0);
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: allocations are not counted under the sanitizer";
  const long before = test::allocation_count();
  for (int t = 0; t < 50; ++t) perception.seen(t, joints);
  EXPECT_EQ(test::allocation_count(), before);
}

std::vector<Perturbation> read(const std::string& list) {
  return parse_suite(
             "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nperturbations: " +
                 list + "\n",
             "p.yaml")
      .perturbations;
}

std::string refusal(const std::string& list) {
  return test::thrown_message<InputError>([&] { read(list); });
}

TEST(Perception, NamesAloneHaveTheDocumentedDefaults) {
  const std::vector<Perturbation> list = read("[jitter, dropout, perception_latency, vanish, freeze, jump]");
  EXPECT_EQ(list[0].perception.jitter, 0.02);
  EXPECT_EQ(list[1].perception.dropout, 0.1);
  EXPECT_EQ(list[2].perception.latency_ms, 200.0);
  EXPECT_EQ(list[3].perception.vanish, 2.0);
  EXPECT_EQ(list[4].perception.freeze->duration, 1.0);
  EXPECT_EQ(list[5].perception.jump->metres, 0.3);
  EXPECT_EQ(list[0].perception.dropout, 0.0);
}

TEST(Perception, WrittenOutItReadsBackToTheSame) {
  const std::string once = to_yaml(
      read("[{name: all, jitter: {sigma: 0.01}, dropout: {p: 0.2}, perception_latency: {ms: 50}, vanish: {at: 4}, "
           "freeze: {at: 1, for: 0.5}, jump: {at: 0, metres: 1}}]")[0]);
  EXPECT_THAT(once, AllOf(HasSubstr("sigma: 0.01"), HasSubstr("for: 0.5")));
  EXPECT_EQ(to_yaml(read("[" + once + "]")[0]), once);
}

TEST(Perception, WhatIsWrongIsNamedWithItsLine) {
  for (const char* text :
       {"[{jitter: {sigma: 0}}]", "[{jitter: {sigam: 1}}]", "[{dropout: {p: 1.5}}]", "[{perception_latency: {ms: -1}}]",
        "[{vanish: {at: -1}}]", "[{freeze: {at: 1, for: 0}}]", "[{jump: {metres: x}}]", "[{jump: 3}]"})
    EXPECT_SENTENCE(refusal(text));
}

constexpr double kRounding = 1e-9;      // [frames] of a play head that adds up speeds
constexpr int kClipFrames = 300;        // 6 s
constexpr Phases kPhases = {100, 200};  // of an episode that begins at the clip's frame kClipFrame
constexpr int kClipFrame = 20;

// The x of every joint is the frame, so that a frame tells where in the clip it is from.
HumanMotion counting_clip() {
  HumanMotion clip;
  clip.joints = PointTracks(kClipFrames, kSmplJoints);
  for (int t = 0; t < kClipFrames; ++t)
    for (int j = 0; j < kSmplJoints; ++j) clip.joints.at(t, j) = Eigen::Vector3d(t, 0.1 * j, 1.0 + 0.01 * j);
  return clip;
}

double frame_at(const PartnerVariation& variation, int tick) {
  return partner_motion(counting_clip(), variation, kPhases, kClipFrame, tick + 1).joints.at(tick, 0).x() - kClipFrame;
}

TEST(PartnerVariation, NoneIsTheClipToTheBit) {
  const HumanMotion clip = counting_clip();
  const HumanMotion same = partner_motion(clip, std::nullopt, kPhases, kClipFrame, 400);
  for (int t = 0; t < 400; ++t)
    EXPECT_EQ(same.joints.frame(t), clip.joints.frame(std::min(t + kClipFrame, kClipFrames - 1))) << t;
  EXPECT_EQ(partner_motion(clip, PartnerVariation{}, kPhases, kClipFrame, 400).joints, same.joints);
}

TEST(PartnerVariation, ALaterPartnerWaits) {
  PartnerVariation later;
  later.shift_s = 1.0;
  EXPECT_EQ(frame_at(later, 50), 0.0);
  EXPECT_EQ(frame_at(later, 51), 1.0);
  EXPECT_EQ(frame_at(later, 150), 100.0);
  EXPECT_EQ(episode_ticks(later, 250), 300);
}

TEST(PartnerVariation, AnEarlierPartnerLacksPartOfItsPreparation) {
  PartnerVariation earlier;
  earlier.shift_s = -0.5;
  EXPECT_EQ(frame_at(earlier, 0), 25.0);
  EXPECT_EQ(frame_at(earlier, 10), 35.0);
  EXPECT_EQ(episode_ticks(earlier, 250), 250);
  earlier.shift_s = -10.0;
  EXPECT_EQ(frame_at(earlier, 0), 100.0);  // the act is the earliest
}

TEST(PartnerVariation, SpeedIsOfTheWholeMotion) {
  PartnerVariation slower;
  slower.speed = 0.8;
  EXPECT_NEAR(frame_at(slower, 100), 80.0, kRounding);
  EXPECT_EQ(episode_ticks(slower, 200), 250);
  PartnerVariation faster;
  faster.speed = 1.25;
  EXPECT_NEAR(frame_at(faster, 40), 50.0, kRounding);
  EXPECT_EQ(episode_ticks(faster, 200), 200);
}

TEST(PartnerVariation, AHesitatingPartnerStandsStillAtHalfOfItsPreparation) {
  PartnerVariation hesitating;
  hesitating.hesitate_s = 1.0;
  EXPECT_EQ(frame_at(hesitating, 50), 50.0);
  EXPECT_EQ(frame_at(hesitating, 100), 50.0);
  EXPECT_EQ(frame_at(hesitating, 101), 51.0);
  EXPECT_EQ(episode_ticks(hesitating, 250), 300);
}

TEST(PartnerVariation, AnAbortingPartnerGoesBackTheWayItCameAndStays) {
  PartnerVariation aborting;
  aborting.abort = true;
  EXPECT_EQ(frame_at(aborting, 150), 150.0);
  EXPECT_EQ(frame_at(aborting, 160), 140.0);
  EXPECT_EQ(frame_at(aborting, 300), 0.0);
  EXPECT_EQ(frame_at(aborting, 320), 0.0);
}

TEST(PartnerVariation, ScaleKeepsTheWayAndTheGround) {
  PartnerVariation taller;
  taller.scale = 1.1;
  const HumanMotion motion = partner_motion(counting_clip(), taller, kPhases, kClipFrame, 30);
  EXPECT_NEAR(motion.joints.at(20, kPelvis).x(), 40.0, kRounding);
  EXPECT_NEAR(motion.joints.at(20, kPelvis).z(), 1.1, kRounding);
  EXPECT_NEAR(motion.joints.at(20, kHead).z(), 1.1 * (1.0 + 0.01 * int{kHead}), kRounding);
  EXPECT_NEAR((motion.joints.at(20, kHead) - motion.joints.at(20, kPelvis)).norm(),
              1.1 * 0.01 * int{kHead} * std::hypot(10.0, 1.0), kRounding);
}

// A person who stands at x = 2 and faces -x, its right hand raised.
HumanMotion standing_clip() {
  HumanMotion clip;
  clip.joints = PointTracks(kClipFrames, kSmplJoints);
  for (int t = 0; t < kClipFrames; ++t) {
    for (int j = 0; j < kSmplJoints; ++j) {
      const double side = kSmplNames[j].starts_with("left") ? -0.2 : kSmplNames[j].starts_with("right") ? 0.2 : 0.0;
      clip.joints.at(t, j) = Eigen::Vector3d(2.0, side, 1.0);
    }
    clip.joints.at(t, kRightHand) = Eigen::Vector3d(1.5, 0.3, 1.2);
  }
  clip.rotations.assign(static_cast<std::size_t>(kClipFrames) * kSmplJoints, yaw_rotation(std::numbers::pi));
  for (int t = 0; t < kClipFrames; ++t)
    clip.rotations[static_cast<std::size_t>(t) * kSmplJoints + kRightHand] =
        yaw_rotation(std::numbers::pi) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX());
  return clip;
}

HumanMotion varied(const PartnerVariation& variation, int frames = 250) {
  return partner_motion(standing_clip(), variation, kPhases, kClipFrame, frames);
}

TEST(PartnerVariation, APartnerWhoComesWalksUpInTheFirstHalfOfItsPreparation) {
  const HumanMotion motion = varied({.comes_m = 1.5});
  EXPECT_NEAR(motion.joints.at(0, kPelvis).x(), 3.5, kRounding);  // behind its place, as it faces -x
  EXPECT_NEAR(motion.joints.at(25, kPelvis).x(), 2.75, kRounding);
  EXPECT_NEAR(motion.joints.at(50, kPelvis).x(), 2.0, kRounding);
  EXPECT_NEAR(motion.joints.at(249, kPelvis).x(), 2.0, kRounding);
  EXPECT_NEAR(motion.joints.at(0, kPelvis).y(), 0.0, kRounding);
}

TEST(PartnerVariation, APartnerWhoMovesOnStaysThere) {
  const HumanMotion motion = varied({.moves_on_m = 0.3, .aside_m = 0.2});
  EXPECT_NEAR(motion.joints.at(50, kPelvis).x(), 2.0, kRounding);
  EXPECT_NEAR(motion.joints.at(75, kPelvis).x(), 2.15, kRounding);
  for (const int t : {100, 249}) {
    EXPECT_NEAR(motion.joints.at(t, kPelvis).x(), 2.3, kRounding) << t;
    EXPECT_NEAR(motion.joints.at(t, kPelvis).y(), -0.2, kRounding) << t;  // its left
    EXPECT_NEAR(motion.joints.at(t, kRightHand).y(), 0.1, kRounding) << t;
  }
}

// A partner who waits before it comes stands where it begins.
TEST(PartnerVariation, WaysGoByItsOwnTime) {
  const HumanMotion motion = varied({.shift_s = 1.0, .comes_m = 1.0});
  EXPECT_NEAR(motion.joints.at(50, kPelvis).x(), 3.0, kRounding);
  EXPECT_NEAR(motion.joints.at(100, kPelvis).x(), 2.0, kRounding);
}

TEST(PartnerVariation, TheOtherHandIsTheMirrorImageInItsOwnMiddlePlane) {
  const HumanMotion motion = varied({.other_hand = true}, 2);
  EXPECT_NEAR((motion.joints.at(1, kLeftHand) - Eigen::Vector3d(1.5, -0.3, 1.2)).norm(), 0.0, kRounding);
  EXPECT_NEAR((motion.joints.at(1, kRightHand) - Eigen::Vector3d(2.0, 0.2, 1.0)).norm(), 0.0, kRounding);
  EXPECT_NEAR((motion.joints.at(1, kHead) - Eigen::Vector3d(2.0, 0.0, 1.0)).norm(), 0.0, kRounding);
  const auto turn = [&](int joint) { return motion.rotations[static_cast<std::size_t>(kSmplJoints + joint)]; };
  EXPECT_NEAR(turn(kHead).angularDistance(yaw_rotation(std::numbers::pi)), 0.0, 1e-7);
  EXPECT_NEAR(turn(kLeftHand).angularDistance(yaw_rotation(std::numbers::pi) *
                                              Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitX())),
              0.0, 1e-7);
  EXPECT_EQ(varied({.other_hand = false}, 2).joints, varied({}, 2).joints);
}

TEST(PartnerVariation, IsReadStrictlyAndWrittenOut) {
  const Perturbation perturbation = read("[{name: slow, partner: {speed: 0.8, abort: true}}]")[0];
  EXPECT_EQ(perturbation.partner->speed, 0.8);
  EXPECT_TRUE(perturbation.partner->abort);
  EXPECT_EQ(perturbation.partner->scale, 1.0);
  const std::string once = to_yaml(perturbation);
  EXPECT_EQ(to_yaml(read("[" + once + "]")[0]), once);
  const auto refusal = [](const std::string& values) {
    return test::thrown_message<InputError>([&] { read("[{partner: " + values + "}]"); });
  };
  for (const char* text : {"{speed: 0}", "{scale: 3}", "{hesitate_s: -1}", "{shift_s: 31}", "{abort: 2}",
                           "{comes_m: -1}", "{moves_on_m: 3}", "{aside_m: 3}", "{other_hand: 2}", "{sped: 2}", "2"})
    EXPECT_SENTENCE(refusal(text));
}

// Hashes of suites of before depend on it.
TEST(PartnerVariation, WhatIsNotAskedForIsNotWritten) {
  EXPECT_EQ(to_yaml(read("[{name: slow, partner: {speed: 0.8}}]")[0]),
            "{name: slow, partner: {scale: 1, speed: 0.8, shift_s: 0, hesitate_s: 0, abort: false}}");
  const std::string all =
      "{name: far, partner: {scale: 1, speed: 1, shift_s: 0, hesitate_s: 0, abort: false, comes_m: 1, moves_on_m: 0.3, "
      "aside_m: -0.2, other_hand: true}}";
  EXPECT_EQ(to_yaml(read("[" + all + "]")[0]), all);
}

// The partner of the recording is the varied one, the robot's reference is not touched.
TEST(PartnerVariation, IsTheRealPartnerOfAnEpisode) {
  const auto robot = test::g1();
  const PairedMotion clip = test::paired(Task::kWave, *robot);
  const auto experiment = test::experiment_of(test::playback_suite(), {clip});
  RolloutSetup setup = experiment->setup(test::first_of(*experiment));
  const auto roll = [&] {
    const auto policy = make_policy("replay", robot);
    return play_back(setup, *policy).recording;
  };
  const Recording clean = roll();
  setup.perturbation.partner = PartnerVariation{.scale = 0.9, .shift_s = 1.0};
  const Recording varied = roll();
  ASSERT_EQ(varied.frames(), clean.frames() + 50);
  EXPECT_NEAR(varied.partner.at(150, kHead).z(), 0.9 * clean.partner.at(100, kHead).z(), kRounding);
  for (int t = 0; t < clean.frames(); t += 29) EXPECT_EQ(varied.reference[t].q, clean.reference[t].q) << t;
}

}  // namespace
}  // namespace duet
