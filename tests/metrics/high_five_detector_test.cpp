#include <gtest/gtest.h>

#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kFrames = 12;

// Right hands meet at frame 4 for `close` frames: the performer's at height `own`, the partner's `gap` further along x
// at height `other` over the performer's root.
test::Scene meet(double gap, double own, double other, int close = 1) {
  test::Scene s{test::standing({0.0, 0.0, 1.0}, 1.0, kFrames), test::standing({5.0, 0.0, 1.0}, -1.0, kFrames)};
  s.performer.rhand.middleCols(4, close) = test::still({0.5, 0.0, 1.0 + own}, close);
  s.partner.rhand.middleCols(4, close) = test::still({0.5 + gap, 0.0, 1.0 + other}, close);
  return s;
}

DetectorResult judge(const test::Scene& s, const Thresholds& tau = {},
                     HighFiveHeight height = HighFiveHeight::kClosestPair) {
  DetectorReadings readings;
  readings.high_five_height = height;
  return detect_performer(Task::kHighFive, s.performer, s.partner, tau, readings);
}

TEST(HighFiveDetector, OneCloseFrameHighEnoughIsEnough) {
  EXPECT_TRUE(judge(meet(0.1, 0.5, 0.5)).success);
  EXPECT_FALSE(judge(meet(0.5, 0.5, 0.5)).success);  // too far apart
  EXPECT_FALSE(judge(meet(0.1, 0.2, 0.2)).success);  // too low
}

TEST(HighFiveDetector, BoundariesAreAsPrinted) {
  EXPECT_FALSE(judge(meet(0.25, 0.5, 0.5), {{"contact", 0.25}}).success);  // d < contact
  EXPECT_TRUE(judge(meet(0.25, 0.5, 0.5), {{"contact", 0.2501}}).success);
  EXPECT_TRUE(judge(meet(0.1, 0.5, 0.5), {{"height", 0.5}}).success);  // height >=
  EXPECT_FALSE(judge(meet(0.1, 0.5, 0.5), {{"height", 0.5001}}).success);
  EXPECT_TRUE(judge(meet(0.1, 0.5, 0.5, 3), {{"max_sustained", 3}}).success);  // run <= max_sustained
  EXPECT_FALSE(judge(meet(0.1, 0.5, 0.5, 4), {{"max_sustained", 3}}).success);
  EXPECT_TRUE(judge(meet(0.1, 0.5, 0.5, 3), {{"min_approach", 3}}).success);
  EXPECT_FALSE(judge(meet(0.1, 0.5, 0.5, 2), {{"min_approach", 3}}).success);
}

TEST(HighFiveDetector, ApproachCountsFramesThatNeedNotBeConsecutive) {
  test::Scene s = meet(0.1, 0.5, 0.5, 5);
  s.performer.rhand.col(6) = Eigen::Vector3d(0.0, 0.0, 0.0);
  EXPECT_TRUE(judge(s, {{"min_approach", 4}}).success);
  EXPECT_FALSE(judge(s, {{"min_approach", 5}}).success);
  EXPECT_EQ(judge(s).values.at("consecutive_count"), 2.0);
}

TEST(HighFiveDetector, HeightReadings) {
  const auto passes = [](const test::Scene& s, HighFiveHeight height) { return judge(s, {}, height).success; };
  const test::Scene own = meet(0.1, 0.35, 0.25);  // performer's hand high, partner's low
  EXPECT_FALSE(passes(own, HighFiveHeight::kClosestPair));
  EXPECT_TRUE(passes(own, HighFiveHeight::kPerformerClosest));
  EXPECT_FALSE(passes(own, HighFiveHeight::kPartnerClosest));
  EXPECT_TRUE(passes(own, HighFiveHeight::kAnyHand));
  EXPECT_TRUE(passes(own, HighFiveHeight::kPerformerAny));
  EXPECT_TRUE(passes(own, HighFiveHeight::kOff));

  const test::Scene other = meet(0.1, 0.25, 0.35);
  EXPECT_FALSE(passes(other, HighFiveHeight::kClosestPair));
  EXPECT_FALSE(passes(other, HighFiveHeight::kPerformerClosest));
  EXPECT_TRUE(passes(other, HighFiveHeight::kPartnerClosest));
  EXPECT_TRUE(passes(other, HighFiveHeight::kAnyHand));
  EXPECT_FALSE(passes(other, HighFiveHeight::kPerformerAny));

  test::Scene idle = meet(0.1, 0.1, 0.1);  // low contact, but the performer's other hand is up
  EXPECT_FALSE(passes(idle, HighFiveHeight::kAnyHand));
  idle.performer.lhand = test::still({-1.0, 0.0, 2.0}, kFrames);
  EXPECT_TRUE(passes(idle, HighFiveHeight::kAnyHand));
  EXPECT_TRUE(passes(idle, HighFiveHeight::kPerformerAny));
  EXPECT_FALSE(passes(idle, HighFiveHeight::kPerformerClosest));
  EXPECT_TRUE(passes(idle, HighFiveHeight::kOff));
}

TEST(HighFiveDetector, HeightIsOverThePerformersRoot) {
  test::Scene s = meet(0.1, 0.5, 0.5);
  s.partner.root.array() += 3.0;
  EXPECT_TRUE(judge(s).success);
  s.performer.root.array() += 0.3;
  EXPECT_FALSE(judge(s).success);
}

TEST(HighFiveDetector, MarginsAreThoseOfTheClosestFrames) {
  const DetectorResult result = judge(meet(0.1, 0.5, 0.4, 2));
  EXPECT_NEAR(result.margins.at("contact"), 0.4 - std::hypot(0.1, 0.1), 1e-12);
  EXPECT_NEAR(result.margins.at("height"), 0.1, 1e-12);
  EXPECT_EQ(result.margins.at("min_approach"), 1.0);
  EXPECT_EQ(result.margins.at("max_sustained"), 998.0);
  EXPECT_FALSE(judge(meet(0.1, 0.5, 0.4), {}, HighFiveHeight::kOff).margins.contains("height"));
}

}  // namespace
}  // namespace duet
