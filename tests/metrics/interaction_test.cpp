// The conditions of the rule `interaction` one by one; whole episodes are judged in made_episodes_test.cpp.
#include "duet/metrics/interaction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/metrics/acting.h"
#include "tests/robots/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

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
    safety.events.push_back({.link = link, .capsule = capsule, .begin = begin, .duration = duration});
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
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { (void)judge_interaction(Task::kWave, e); }),
              HasSubstr("cannot be judged under `interaction`: no partner was recorded"));
}

}  // namespace
}  // namespace duet
