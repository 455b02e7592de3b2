#include "duet/datasets/curation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <utility>

#include "duet/motion/synthesis/synthesis.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

InteractionClip good() { return synthesize(Task::kHandshake, {.seed = 11}); }

const CriterionFinding& finding(const CurationResult& verdict, std::string_view name) {
  return *std::ranges::find_if(verdict.findings, [&](const CriterionFinding& f) { return f.criterion->name == name; });
}

std::vector<std::string> failing(const InteractionClip& clip, const CurationOptions& options = {}) {
  std::vector<std::string> names;
  for (const CriterionFinding& found : curate(clip, options).findings)
    if (!found.passed) names.emplace_back(found.criterion->name);
  return names;
}

TEST(Curation, EveryTaskAsSynthesisedPassesAllGates) {
  for (const Task task : kPaperTasks) EXPECT_THAT(failing(synthesize(task, {.seed = 5})), IsEmpty()) << to_string(task);
}

TEST(Curation, AJointThatJumpsIsATrackingError) {
  InteractionClip clip = good();
  for (const int t : {100, 102, 104}) clip.a.joints.frame(t).col(kLeftHand) += Eigen::Vector3d(0.0, 0.0, 1.5);
  const CurationResult verdict = curate(clip);
  EXPECT_FALSE(finding(verdict, "joint_speed").passed);
  EXPECT_NEAR(finding(verdict, "joint_speed").worst_frame, 102, 3);
  EXPECT_THAT(verdict.refused_by(), ElementsAre(Gate::kMotionFidelity));
}

TEST(Curation, ASingleFrameOfNoiseIsNone) {
  InteractionClip clip = good();
  clip.a.joints.frame(100).col(kLeftHand) += Eigen::Vector3d(0.0, 0.0, 0.5);
  EXPECT_THAT(failing(clip), IsEmpty());
}

// The right forearm of B is longer by `share` in 45 of 100 frames.
InteractionClip with_growing_forearm(double share) {
  InteractionClip clip = good();
  for (int t = 0; t < clip.frames(); ++t) {
    const Eigen::Vector3d forearm = clip.b.joints.at(t, kRightWrist) - clip.b.joints.at(t, kRightElbow);
    for (const int j : {kRightWrist, kRightHand}) clip.b.joints.frame(t).col(j) += share * (t % 100 < 45) * forearm;
  }
  return clip;
}

TEST(Curation, BonesThatGrowAreATrackingError) {
  EXPECT_FALSE(finding(curate(with_growing_forearm(0.6)), "bone_change").passed);
  EXPECT_NEAR(limb_bone_change(with_growing_forearm(0.6)), 0.6, 0.01);
  EXPECT_TRUE(finding(curate(with_growing_forearm(0.4)), "bone_change").passed);
}

// A tracker whose bones change in every recording is not broken in each.
TEST(Curation, BonesAreHeldAgainstWhatIsUsualInTheirSource) {
  const InteractionClip clip = with_growing_forearm(0.6);
  EXPECT_TRUE(finding(curate(clip, {.source_bone_change = 0.45}), "bone_change").passed);
  EXPECT_FALSE(finding(curate(clip, {.source_bone_change = 0.35}), "bone_change").passed);
  EXPECT_FALSE(
      finding(curate(clip, {.limits = {{"bone_change", 0.25}}, .source_bone_change = 1.0}), "bone_change").passed)
      << "what is told holds for every source";
}

TEST(Curation, AWaveAtTheChestIsSeenUnlessThePrintedHeightIsAskedFor) {
  InteractionClip clip = synthesize(Task::kWave, {.seed = 11});
  const auto lowered = [&](double down) {
    InteractionClip low = clip;
    for (HumanMotion* person : {&low.a, &low.b})
      for (int t = 0; t < low.frames(); ++t)
        for (const int hand : {kLeftHand, kRightHand}) person->joints.frame(t)(2, hand) -= down;
    return low;
  };
  double highest = 0.0;
  for (const HumanMotion* person : {&clip.a, &clip.b})
    for (int t = 0; t < clip.frames(); ++t)
      for (const int hand : {kLeftHand, kRightHand})
        highest = std::max(highest, person->joints.at(t, hand).z() - person->joints.at(t, kPelvis).z());
  const InteractionClip at_chest = lowered(highest - 0.4), below = lowered(highest - 0.3);
  EXPECT_EQ(finding(curate(at_chest), "task_seen").value, 0.5);
  EXPECT_TRUE(finding(curate(at_chest), "task_seen").passed);
  EXPECT_FALSE(finding(curate(at_chest, {.limits = {{"task_seen", 1.0}}}), "task_seen").passed);
  EXPECT_EQ(finding(curate(below), "task_seen").value, 0.0);
  EXPECT_EQ(finding(curate(clip), "task_seen").value, 1.0);
}

// A depth camera's error where two who hug hide each other: left and right are exchanged from one frame on.
TEST(Curation, WhoTurnsAboutWithinTheActIsATrackersExchangeOfSides) {
  for (const bool of_a : {false, true}) {
    InteractionClip clip = synthesize(Task::kHug, {.seed = 11});
    PointTracks& joints = (of_a ? clip.a : clip.b).joints;
    const int middle = (clip.phases.act_begin + clip.phases.act_end) / 2;
    for (int t = middle; t < clip.frames(); ++t)
      for (const auto& [left, right] : {std::pair{kLeftHip, kRightHip}, std::pair{kLeftShoulder, kRightShoulder}}) {
        const Eigen::Vector3d kept = joints.at(t, left);
        joints.at(t, left) = Eigen::Vector3d(joints.at(t, right));
        joints.at(t, right) = kept;
      }
    const CriterionFinding found = finding(curate(clip), "act_turn");
    EXPECT_FALSE(found.passed);
    EXPECT_NEAR(found.value, std::numbers::pi, 0.2);
    EXPECT_EQ(found.worst_frame, middle);
  }
}

TEST(Curation, ATurnBeforeTheActIsNone) {
  InteractionClip clip = good();
  EXPECT_LT(finding(curate(clip), "act_turn").value, 0.3);
  clip.phases = {0, clip.frames()};
  EXPECT_GT(finding(curate(clip), "act_turn").value, 1.7);
  EXPECT_FALSE(finding(curate(clip, {.limits = {{"act_turn", 1.7}}}), "act_turn").passed);
}

TEST(Curation, PeopleOfTheWrongSizeAreNone) {
  InteractionClip clip = good();
  for (HumanMotion* person : {&clip.a, &clip.b})
    for (int t = 0; t < clip.frames(); ++t) person->joints.frame(t) *= 3.0;
  EXPECT_FALSE(finding(curate(clip), "implausible").passed);
}

TEST(Curation, AWaveIsNoHandshake) {
  InteractionClip clip = synthesize(Task::kWave, {.seed = 11});
  clip.task = Task::kHandshake;
  EXPECT_THAT(failing(clip), ElementsAre("task_seen"));
  EXPECT_THAT(curate(clip).refused_by(), ElementsAre(Gate::kInteractionClarity));
}

TEST(Curation, AnActOfAFewFramesIsNotClear) {
  InteractionClip clip = good();
  clip.phases.act_end = clip.phases.act_begin + 9;
  EXPECT_THAT(failing(clip), ElementsAre("act_seconds"));
  clip.phases.act_end = clip.phases.act_begin + 10;  // 0.2 s, the limit itself
  EXPECT_THAT(failing(clip), IsEmpty());
}

TEST(Curation, ARunIsTooFastForTheRobotAndNotForThePartner) {
  InteractionClip clip = good();
  const auto run = [&](HumanMotion& person) {
    for (int t = 0; t < clip.frames(); ++t) person.joints.frame(t).row(1).array() += 3.0 * t / 50.0;
  };
  run(clip.a);  // B is replaced
  EXPECT_TRUE(finding(curate(clip), "root_speed").passed);
  clip.reactor = Person::kA;
  EXPECT_FALSE(finding(curate(clip), "root_speed").passed);
  EXPECT_NEAR(finding(curate(clip), "root_speed").value, 3.0, 1.0);
}

TEST(Curation, WhoSitsDownIsNotAchievable) {
  InteractionClip clip = good();
  for (int t = 200; t < 240; ++t)
    for (int j = 0; j < kSmplJoints; ++j)
      if (clip.b.joints.at(t, j).z() > 0.6) clip.b.joints.frame(t)(2, j) -= 0.55;
  EXPECT_FALSE(finding(curate(clip), "pelvis_height").passed);
  EXPECT_EQ(finding(curate(clip), "pelvis_height").criterion->gate, Gate::kKinematicFeasibility);
}

TEST(Curation, WhatBeginsOrEndsWithinTheActIsNotComplete) {
  InteractionClip clip = good();
  const CurationOptions options{.limits = {}, .gates = {Gate::kTemporalCompleteness}};  // they turn to leave
  clip.phases.act_begin = 9;
  EXPECT_THAT(failing(clip, options), ElementsAre("before_act"));
  clip.phases.act_begin = 10;
  EXPECT_THAT(failing(clip, options), IsEmpty());
  clip.phases.act_end = clip.frames() - 9;
  EXPECT_THAT(failing(clip, options), ElementsAre("after_act"));
  EXPECT_THAT(curate(clip, options).refused_by(), ElementsAre(Gate::kTemporalCompleteness));
  EXPECT_EQ(curate(clip, options).worst_frame(), clip.frames() - 1);
}

TEST(Curation, OnlyTheGatesAskedForAreJudged) {
  InteractionClip clip = good();
  clip.phases.act_begin = 0;
  EXPECT_THAT(failing(clip, {.gates = {Gate::kMotionFidelity, Gate::kInteractionClarity}}), IsEmpty());
  EXPECT_TRUE(curate(clip, {.gates = {}}).passed());
  EXPECT_EQ(curate(clip, {.gates = {}}).worst_frame(), 0);
}

TEST(Curation, LimitsAreSetByName) {
  CurationOptions options;
  set_limit(options, "before_act", "1e6");
  EXPECT_THAT(failing(good(), options), ElementsAre("before_act"));
  EXPECT_SENTENCE(curate(good(), options).reasons().front());
  try {
    set_limit(options, "before", "1");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_SENTENCE(error.what());
  }
  EXPECT_THROW(set_limit(options, "before_act", "nan"), std::invalid_argument);
}

}  // namespace
}  // namespace duet
