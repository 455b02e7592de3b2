#include "duet/datasets/curation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "duet/motion/synthesis.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

InteractionClip good() { return synthesize(Task::kHandshake, {.seed = 11}); }

const CriterionFinding& finding(const CurationVerdict& verdict, std::string_view name) {
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
  const CurationVerdict verdict = curate(clip);
  EXPECT_FALSE(finding(verdict, "joint_speed").passed);
  EXPECT_NEAR(finding(verdict, "joint_speed").worst_frame, 102, 3);
  EXPECT_THAT(verdict.refused_by(), ElementsAre(Gate::kMotionFidelity));
}

TEST(Curation, ASingleFrameOfNoiseIsNone) {
  InteractionClip clip = good();
  clip.a.joints.frame(100).col(kLeftHand) += Eigen::Vector3d(0.0, 0.0, 0.5);
  EXPECT_THAT(failing(clip), IsEmpty());
}

TEST(Curation, BonesThatGrowAreATrackingError) {
  InteractionClip clip = good();
  for (int t = 0; t < clip.frames(); ++t)
    for (const int j : {kRightWrist, kRightHand})
      clip.b.joints.frame(t).col(j) +=
          0.5 * (t % 100 < 50) * (clip.b.joints.at(t, kRightElbow) - clip.b.joints.at(t, kRightShoulder));
  EXPECT_FALSE(finding(curate(clip), "bone_change").passed);
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
  clip.phases.act_begin = 9;
  EXPECT_THAT(failing(clip), ElementsAre("before_act"));
  clip.phases.act_begin = 10;
  EXPECT_THAT(failing(clip), IsEmpty());
  clip.phases.act_end = clip.frames() - 9;
  EXPECT_THAT(failing(clip), ElementsAre("after_act"));
  EXPECT_THAT(curate(clip).refused_by(), ElementsAre(Gate::kTemporalCompleteness));
  EXPECT_EQ(curate(clip).worst_frame(), clip.frames() - 1);
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
  EXPECT_THAT(curate(good(), options).reasons().front(), HasSubstr("time before the act: "));
  EXPECT_THAT(curate(good(), options).reasons().front(), HasSubstr("s, expected at least 1e+06 (frame 0)"));
  try {
    set_limit(options, "before", "1");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("unknown curation criterion 'before'"));
  }
  EXPECT_THROW(set_limit(options, "before_act", "nan"), std::invalid_argument);
}

}  // namespace
}  // namespace duet
