#include <gtest/gtest.h>

#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kFrames = 20;
constexpr double kFar = 8.0;

// Hands by their distance from the partner's torso at the origin, on either side of it along y, for `close` frames.
struct HugScene {
  Agent performer, partner;
};
HugScene hug(double left, double right, int close) {
  HugScene s;
  s.partner.torso = test::still({0.0, 0.0, 0.0}, kFrames);
  s.partner.lshoulder = test::still({0.0, 0.0, kFar}, kFrames);
  s.partner.rshoulder = test::still({0.0, 0.0, -kFar}, kFrames);
  s.performer.lhand = test::still({0.0, -kFar, 0.0}, kFrames);
  s.performer.rhand = test::still({0.0, kFar, 0.0}, kFrames);
  s.performer.lhand.leftCols(close) = test::still({0.0, -left, 0.0}, close);
  s.performer.rhand.leftCols(close) = test::still({0.0, right, 0.0}, close);
  return s;
}

DetectorResult judge(const HugScene& s, const Thresholds& tau, HugSingle single, HugShoulder shoulder) {
  DetectorReadings readings;
  readings.hug_single = single;
  readings.hug_shoulder = shoulder;
  return detect_performer(Task::kHug, s.performer, s.partner, tau, readings);
}
bool doubled(const HugScene& s, const Thresholds& tau = {}) {
  return judge(s, tau, HugSingle::kOff, HugShoulder::kOff).success;
}
bool single(const HugScene& s, HugSingle reading, const Thresholds& tau = {}) {
  return judge(s, tau, reading, HugShoulder::kOff).parts.at("single_embrace");
}
bool shoulder(const HugScene& s, HugShoulder reading, const Thresholds& tau = {}) {
  return judge(s, tau, HugSingle::kOff, reading).parts.at("shoulder_embrace");
}

TEST(HugDetector, DoubleEmbraceNeedsHandsTogetherAtTheTorsoLongEnough) {
  EXPECT_TRUE(doubled(hug(0.2, 0.2, 3)));
  EXPECT_FALSE(doubled(hug(0.2, 0.2, 2)));     // too short
  EXPECT_FALSE(doubled(hug(0.26, 0.26, 10)));  // hands 0.52 apart
  EXPECT_FALSE(doubled(hug(0.0, 0.46, 10)));   // one hand off the torso
}

TEST(HugDetector, BoundariesAreStrict) {
  const Thresholds tau = {{"hand_dist", 0.5}, {"body", 0.25}};
  EXPECT_FALSE(doubled(hug(0.25, 0.125, 5), tau));  // body exactly
  EXPECT_TRUE(doubled(hug(0.2499, 0.125, 5), tau));
  EXPECT_FALSE(doubled(hug(0.25, 0.25, 5), {{"hand_dist", 0.5}, {"body", 0.5}}));  // hands exactly
  EXPECT_TRUE(doubled(hug(0.25, 0.25, 5), {{"hand_dist", 0.5001}, {"body", 0.5}}));
  EXPECT_FALSE(single(hug(0.25, kFar, 5), HugSingle::kAnyHand, tau));
  EXPECT_FALSE(shoulder(hug(0.25, 0.25, 5), HugShoulder::kTorsoBoth, {{"shoulder", 0.25}}));
}

// The shoulder embrace is decided by the farther hand: its figure is printed beside the nearer one's.
TEST(HugDetector, BothHandsFiguresAreThoseThatDecide) {
  HugScene s = hug(0.2, 0.35, 5);
  s.partner.lshoulder = s.partner.torso;
  const DetectorResult result = judge(s, {}, HugSingle::kOff, HugShoulder::kBothHands);
  EXPECT_DOUBLE_EQ(result.values.at("shoulder_distance_min"), 0.2);
  EXPECT_DOUBLE_EQ(result.values.at("shoulder_distance_both_min"), 0.35);
  EXPECT_DOUBLE_EQ(result.values.at("torso_distance_min"), 0.2);
  EXPECT_DOUBLE_EQ(result.values.at("torso_distance_both_min"), 0.35);
  EXPECT_NEAR(result.margins.at("shoulder"), 0.4 - result.values.at("shoulder_distance_both_min"), 1e-15);
}

TEST(HugDetector, FramesMustBeConsecutive) {
  HugScene s = hug(0.2, 0.2, 5);
  s.performer.lhand.col(2) = Eigen::Vector3d(0.0, kFar, 0.0);
  EXPECT_FALSE(doubled(s));
  EXPECT_TRUE(doubled(s, {{"min_frames", 2}}));
}

TEST(HugDetector, SingleEmbraceReadings) {
  const HugScene left = hug(0.3, kFar, 5);
  EXPECT_TRUE(single(left, HugSingle::kAnyHand));
  EXPECT_TRUE(single(left, HugSingle::kSameHand));
  EXPECT_TRUE(single(left, HugSingle::kExactlyOne));
  EXPECT_FALSE(single(left, HugSingle::kOff));

  const HugScene two = hug(0.3, 0.3, 5);
  EXPECT_TRUE(single(two, HugSingle::kAnyHand));
  EXPECT_TRUE(single(two, HugSingle::kSameHand));
  EXPECT_FALSE(single(two, HugSingle::kExactlyOne));

  // Hands take turns: two frames the left, two frames the right.
  HugScene turns = hug(kFar, kFar, 0);
  for (int t = 0; t < 2; ++t) turns.performer.lhand.col(t).setZero();
  for (int t = 2; t < 4; ++t) turns.performer.rhand.col(t).setZero();
  EXPECT_TRUE(single(turns, HugSingle::kAnyHand));
  EXPECT_FALSE(single(turns, HugSingle::kSameHand));
  EXPECT_TRUE(single(turns, HugSingle::kExactlyOne));
}

TEST(HugDetector, SingleEmbraceContainsTheDoubleOne) {
  for (int seed = 0; seed < 40; ++seed) {
    const test::Scene s = test::acting(Task::kHug, seed);
    const DetectorResult result = detect_performer(Task::kHug, s.performer, s.partner, {});
    if (result.parts.at("double_embrace")) {
      EXPECT_TRUE(result.parts.at("single_embrace")) << seed;
    }
  }
}

TEST(HugDetector, ShoulderEmbraceReadings) {
  HugScene both = hug(2.0, 2.0, 5);  // hands 2 m from the torso, each at a shoulder
  both.partner.lshoulder = test::still({0.0, -2.3, 0.0}, kFrames);
  both.partner.rshoulder = test::still({0.0, 2.3, 0.0}, kFrames);
  EXPECT_TRUE(shoulder(both, HugShoulder::kBothHands));
  EXPECT_TRUE(shoulder(both, HugShoulder::kAnyHand));
  EXPECT_FALSE(shoulder(both, HugShoulder::kTorsoBoth));
  EXPECT_FALSE(shoulder(both, HugShoulder::kTorsoAny));
  EXPECT_FALSE(shoulder(both, HugShoulder::kOff));

  HugScene one = both;
  one.performer.rhand = test::still({0.0, 5.0, 0.0}, kFrames);
  EXPECT_FALSE(shoulder(one, HugShoulder::kBothHands));
  EXPECT_TRUE(shoulder(one, HugShoulder::kAnyHand));

  const HugScene torso = hug(0.39, 3.0, 5);
  EXPECT_FALSE(shoulder(torso, HugShoulder::kTorsoBoth));
  EXPECT_TRUE(shoulder(torso, HugShoulder::kTorsoAny));
  EXPECT_TRUE(shoulder(hug(0.39, 0.39, 5), HugShoulder::kTorsoBoth));
}

TEST(HugDetector, OverallMarginIsTheBestModes) {
  const HugScene s = hug(0.1, kFar, 5);
  const DetectorResult result = judge(s, {}, HugSingle::kAnyHand, HugShoulder::kTorsoAny);
  EXPECT_NEAR(result.margins.at("body"), 0.35, 1e-12);
  EXPECT_NEAR(result.margins.at("shoulder"), 0.3, 1e-12);
  EXPECT_NEAR(result.margins.at("overall"), 0.35, 1e-12);
  EXPECT_EQ(result.margins.at("min_frames"), 2.0);
  EXPECT_LT(result.margins.at("hand_dist"), 0.0);
  const DetectorResult only_double = judge(hug(0.2, 0.2, 5), {}, HugSingle::kOff, HugShoulder::kOff);
  EXPECT_NEAR(only_double.margins.at("overall"), 0.1, 1e-12);  // hands 0.4 apart; the torso leaves 0.25
  EXPECT_NEAR(only_double.margins.at("hand_dist"), 0.1, 1e-12);
  EXPECT_NEAR(only_double.margins.at("body"), 0.25, 1e-12);
}

TEST(HugDetector, OverallMarginHasTheSignOfTheVerdictUnderEveryReading) {
  for (int seed = 0; seed < 20; ++seed) {
    const test::Scene s = test::acting(Task::kHug, seed);
    for (const HugSingle one : {HugSingle::kAnyHand, HugSingle::kSameHand, HugSingle::kExactlyOne, HugSingle::kOff}) {
      for (const HugShoulder other : {HugShoulder::kBothHands, HugShoulder::kTorsoBoth, HugShoulder::kOff}) {
        const DetectorResult result = judge({s.performer, s.partner}, {}, one, other);
        EXPECT_EQ(result.success, result.margins.at("overall") > 0.0) << seed;
      }
    }
  }
}

TEST(HugDetector, EvidenceIsTheFramesOfTheEmbrace) {
  const DetectorResult result = judge(hug(0.2, kFar, 4), {}, HugSingle::kAnyHand, HugShoulder::kOff);
  for (int t = 0; t < kFrames; ++t) EXPECT_EQ(result.frames[t], t < 4) << t;
}

}  // namespace
}  // namespace duet
