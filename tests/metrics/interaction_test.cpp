// The conditions of the rule `interaction` one by one; whole episodes are judged in made_episodes_test.cpp.
#include "duet/metrics/interaction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "duet/core/recording.h"
#include "duet/robots/kinematics.h"
#include "tests/metrics/acting.h"
#include "tests/robots/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr int kFrames = 200;

// Stands still, but for its right hand, which is `rise` higher in the frames [begin, end).
Agent raising(double rise, int begin, int end, double facing = 1.0) {
  Agent agent = test::standing({0.0, 0.0, 0.9}, facing, kFrames);
  for (int t = begin; t < end; ++t) agent.rhand(2, t) += rise;
  return agent;
}

TEST(ActOnset, IsAHandThatRisesByAFifthOfAnArmAndStaysUp) {
  const double fifth = 0.2 * kAdultArm;
  EXPECT_NEAR(act_onset(ActOnset::kHandRises, raising(2.0 * fifth, 80, 120)).value(), 80, 3);
  EXPECT_FALSE(act_onset(ActOnset::kHandRises, raising(0.9 * fifth, 80, 120)));
  EXPECT_FALSE(act_onset(ActOnset::kHandRises, raising(2.0 * fifth, 80, 90))) << "a swing of walking";
  EXPECT_FALSE(act_onset(ActOnset::kNone, raising(2.0 * fifth, 80, 120)));
}

// A robot whose arms sink from where it carries them has begun nothing; it begins from the lowest place.
TEST(ActOnset, SinkingHandsBeginNothing) {
  Agent agent = raising(-0.3, 20, kFrames);
  EXPECT_FALSE(act_onset(ActOnset::kHandRises, agent));
  for (int t = 100; t < kFrames; ++t) agent.rhand(2, t) += 0.2;
  EXPECT_NEAR(act_onset(ActOnset::kHandRises, agent).value(), 100, 3);
}

TEST(ActOnset, OfABowIsATrunkThatLeans) {
  Agent agent = test::standing({0.0, 0.0, 0.9}, 1.0, kFrames);
  for (int t = 60; t < 140; ++t) agent.head.col(t).x() += 0.65 * std::tan(11.0 * std::numbers::pi / 180.0);
  EXPECT_NEAR(act_onset(ActOnset::kTrunkLeans, agent).value(), 60, 3);
}

// A false start that is withdrawn is the onset.
TEST(ActOnset, CountsWhatIsWithdrawn) {
  Agent agent = raising(0.3, 40, 60);
  for (int t = 120; t < 160; ++t) agent.rhand(2, t) += 0.3;
  EXPECT_NEAR(act_onset(ActOnset::kHandRises, agent).value(), 40, 3);
}

InteractionEvidence answering(int own, int partner) {
  InteractionEvidence e{.performer = raising(0.4, own, own + 40), .partner = raising(0.4, partner, partner + 40, -1.0)};
  e.window = {0, kFrames};
  return e;
}

bool replies(const InteractionEvidence& e) { return judge_interaction(Task::kWave, e).parts.at("reply"); }

TEST(Interaction, ARobotMayBeginHalfASecondBeforeItsPartnerAndNoSooner) {
  EXPECT_TRUE(replies(answering(120, 80)));
  EXPECT_TRUE(replies(answering(80, 104)));
  EXPECT_FALSE(replies(answering(80, 107)));
  const DetectorResult result = judge_interaction(Task::kWave, answering(80, 107));
  EXPECT_NEAR(result.values.at("lead_s"), 0.54, 1e-9);
  EXPECT_NEAR(result.margins.at("reply"), -0.04, 1e-9);
}

// In the place of somebody who began, it may begin as he did.
TEST(Interaction, NobodyWaitsLongerThanThePersonInItsPlace) {
  InteractionEvidence e = answering(60, 120);
  EXPECT_FALSE(replies(e));
  e.model = raising(0.4, 40, 80);
  e.model_begin = 30;  // he began at 70
  EXPECT_TRUE(replies(e));
  e.performer = raising(0.4, 50, 80);
  EXPECT_FALSE(replies(e));
}

// A robot that pecks at the air never keeps a hand up; where that passes for the act, its first peck is the begin.
TEST(Interaction, WhoeverActsHasBegun) {
  InteractionEvidence e = answering(150, 100);
  e.performer = test::standing({0.0, 0.0, 0.9}, 1.0, kFrames);
  EXPECT_FALSE(act_onset(ActOnset::kHandRises, e.performer));
  const auto peck = [&](int begin) {
    for (int t = begin; t < begin + 9; ++t) e.performer.rhand(2, t) += 0.55;
  };
  for (const int begin : {20, 60, 110}) peck(begin);
  EXPECT_FALSE(act_onset(ActOnset::kHandRises, e.performer));
  const Eigen::Vector3d met = e.performer.rhand.col(115);
  e.partner = test::standing({0.9, 0.0, 0.9}, -1.0, kFrames);
  for (int t = 100; t < 140; ++t) e.partner.rhand.col(t) = met;
  const DetectorResult result = judge_interaction(Task::kHighFive, e);
  ASSERT_TRUE(result.parts.at("act"));
  EXPECT_FALSE(result.parts.at("reply"));
  EXPECT_NEAR(result.values.at("lead_s"), (100 - 20) / 50.0, 0.1);
}

// Shoulders are 0.34 m apart: a ghost's trunk is passed through below 0.44 of that.
TEST(Interaction, AGhostIsNotWalkedThrough) {
  const auto passing = [](double aside) {
    InteractionEvidence e = answering(150, 120);
    for (Eigen::Matrix3Xd* track : test::tracks_of(e.performer))
      for (int t = 0; t < kFrames; ++t) track->col(t) += Eigen::Vector3d(2.0 * t / kFrames, 0.0, 0.0);
    e.partner = test::transformed(
        e.partner, [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return p + Eigen::Vector3d(1.0, aside, 0.0); });
    return e;
  };
  EXPECT_TRUE(judge_interaction(Task::kWave, passing(0.17)).parts.at("body"));
  const DetectorResult through = judge_interaction(Task::kWave, passing(0.13));
  EXPECT_FALSE(through.parts.at("body"));
  EXPECT_NEAR(through.values.at("trunks_apart"), 0.13 / 0.34, 0.02);
  EXPECT_NEAR(through.margins.at("body"), through.values.at("trunks_apart") - 0.44, 1e-12);
  InteractionEvidence solid = passing(0.13);
  solid.touch = PartnerTouch{};
  EXPECT_FALSE(judge_interaction(Task::kWave, solid).parts.contains("body")) << "physics keeps them apart";
}

TEST(Interaction, APartnerWhoStandsStillIsNotWaitedFor) {
  InteractionEvidence e = answering(60, 120);
  e.partner = test::standing({1.5, 0.0, 0.9}, -1.0, kFrames);
  EXPECT_TRUE(replies(e));
}

TEST(Interaction, TimesOfTouchAreOfTheRightBodiesAndInTheWindow) {
  const RobotModel& g1 = test::g1();
  HumanBody human;
  human.capsules = {{.name = "right_hand", .region = "hand"}, {.name = "chest", .region = "chest"}};
  const int hand = g1.frames[g1.track_frame("rhand")].link, pelvis = 0;
  ContactSafetyResult safety;
  safety.settled_ratio = 0.5;
  const auto touch = [&](int link, int capsule, double begin, double duration) {
    safety.events.push_back({{.begin_s = begin, .duration_s = duration}, link, capsule});
  };
  touch(hand, 0, 1.0, 0.4);
  touch(hand, 0, 1.2, 0.4);  // both at once count once
  touch(hand, 0, 3.9, 1.0);  // beyond the window
  touch(pelvis, 0, 2.0, 1.0);
  touch(hand, 1, 2.0, 0.7);
  touch(pelvis, 1, 2.0, 1.0);
  const PartnerTouch seen = partner_touch(safety, g1, human, {0, 200}, 50.0);
  EXPECT_NEAR(seen.hands_s, 0.7, 1e-12);
  EXPECT_NEAR(seen.trunk_s, 0.7, 1e-12);
  EXPECT_EQ(seen.settled_ratio, 0.5);
}

TEST(Interaction, WhatCannotBeJudgedIsSaid) {
  InteractionEvidence e = answering(80, 80);
  EXPECT_EQ(cannot_judge(Task::kWave, e), "");
  e.partner = {};
  EXPECT_EQ(cannot_judge(Task::kWave, e), "no partner was recorded");
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)judge_interaction(Task::kWave, e); }));
}

constexpr double kRate = 50.0;

// At rest until `begin`, then so far away along x.
Eigen::Matrix3Xd step(int frames, int begin, double distance) {
  Eigen::Matrix3Xd track = Eigen::Matrix3Xd::Constant(3, frames, 0.3);
  for (int t = begin; t < frames; ++t) track(0, t) += distance;
  return track;
}

TEST(Onset, AStepIsFoundWithinItsWindow) {
  // The mean over 10 frames passes 0.12 m where two of them are at 0.8 m: eight frames before the step.
  EXPECT_DOUBLE_EQ(onset({step(200, 120, 0.8)}, kRate), (120 - 8) / kRate);
  EXPECT_DOUBLE_EQ(onset({step(200, 120, 0.13)}, kRate), 120 / kRate);
}

TEST(Onset, TheFirstHandCounts) { EXPECT_DOUBLE_EQ(onset({step(200, 150, 0.13), step(200, 100, 0.13)}, kRate), 2.0); }

TEST(Onset, NothingBeyondTheThresholdIsNone) {
  EXPECT_TRUE(std::isnan(onset({step(200, 100, 0.119)}, kRate)));
  EXPECT_TRUE(std::isnan(onset({step(200, 300, 0.0)}, kRate)));
  EXPECT_TRUE(std::isnan(onset({}, kRate)));
}

TEST(Onset, AMotionThatEndsTooSoonHasNone) {
  EXPECT_TRUE(std::isnan(onset({step(30, 0, 1.0)}, kRate)));
  EXPECT_TRUE(std::isnan(onset({step(88, 50, 1.0)}, kRate)));  // one window short of the stay
  EXPECT_DOUBLE_EQ(onset({step(89, 50, 1.0)}, kRate), 1.0);
}

// Arms swing by half of a second to either side while a person walks.
TEST(Onset, ASwingThatComesBackIsNone) {
  Eigen::Matrix3Xd track = Eigen::Matrix3Xd::Zero(3, 400);
  for (int t = 0; t < 400; ++t) track(0, t) = 0.3 * std::sin(2.0 * std::numbers::pi * t / kRate);
  EXPECT_TRUE(std::isnan(onset({track}, kRate)));
  track.rightCols(150).row(2).array() += 0.3;
  const double found = onset({track}, kRate);
  EXPECT_NEAR(found, 5.0, kOnsetWindow + 0.5);  // at most half a swing before
}

TEST(Onset, TheRestIsTheMedianOfTheFirstSecond) {
  Eigen::Matrix3Xd track = step(200, 140, 0.19);
  track.leftCols(20).array() += 5.0;                           // less than half of it
  EXPECT_DOUBLE_EQ(onset({track}, kRate), (140 - 3) / kRate);  // seven frames of ten: 0.133 m; six: 0.114 m
}

// A robot that walks and turns with its arms still begins nothing; one that lifts an arm begins there.
TEST(Onset, OfARobotIsInItsPelvisFrame) {
  const auto robot = load_shared_robot();
  Recording recording;
  for (int t = 0; t < 200; ++t) {
    RobotState state = robot->standing_state({yaw_rotation(0.02 * t), {0.02 * t, 0.0, 0.8}});
    state.X_WB = {yaw_rotation(0.02 * t), {0.02 * t, 0.0, 0.8}};
    recording.robot.push_back(state);
  }
  recording.partner = PointTracks();
  EXPECT_TRUE(std::isnan(onsets(recording, *robot).at("onset_s")));
  EXPECT_FALSE(onsets(recording, *robot).contains("partner_onset_s"));
  int shoulder = -1;
  for (int j = 0; j < robot->dof(); ++j)
    if (robot->joints[static_cast<std::size_t>(j)].name == "left_shoulder_pitch_joint") shoulder = j;
  ASSERT_GE(shoulder, 0);
  for (std::size_t t = 100; t < 200; ++t) recording.robot[t].q[shoulder] -= 1.5;
  const double found = onsets(recording, *robot).at("onset_s");
  EXPECT_GE(found, 1.8);
  EXPECT_LE(found, 2.0);
}

TEST(Onset, OfAPartnerIsInItsRootFrame) {
  Recording recording;
  recording.partner = PointTracks(200, kSmplJoints);
  for (int t = 0; t < 200; ++t) {
    const Eigen::Vector3d root(0.03 * t, 0.0, 0.9);
    const Eigen::Quaterniond turn = yaw_rotation(0.015 * t);
    for (int j = 0; j < kSmplJoints; ++j) recording.partner.at(t, j) = root;
    recording.partner.at(t, kLeftHip) += turn * Eigen::Vector3d(0.0, 0.1, 0.0);
    recording.partner.at(t, kRightHip) += turn * Eigen::Vector3d(0.0, -0.1, 0.0);
    recording.partner.at(t, kLeftWrist) += turn * Eigen::Vector3d(0.0, 0.4, 0.0);
    recording.partner.at(t, kRightWrist) += turn * Eigen::Vector3d(t < 125 ? 0.0 : 0.13, -0.4, 0.0);
  }
  const auto robot = load_shared_robot();
  for (int t = 0; t < 200; ++t) recording.robot.push_back(robot->standing_state({}));
  EXPECT_DOUBLE_EQ(onsets(recording, *robot).at("partner_onset_s"), 2.5);
}

}  // namespace
}  // namespace duet
