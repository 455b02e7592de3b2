#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kFrames = 20;

// Head 0.6 m over the root, tilted towards (cos azimuth, sin azimuth) by `angle` during the frames listed.
test::Scene bow(double angle, const std::vector<int>& frames, double azimuth = 0.0) {
  test::Scene s{test::standing({0.0, 0.0, 1.0}, 1.0, kFrames), test::standing({2.0, 0.0, 1.0}, -1.0, kFrames)};
  s.performer.head = test::still({0.0, 0.0, 1.6}, kFrames);
  for (const int t : frames)
    s.performer.head.col(t) = Eigen::Vector3d(0.6 * std::sin(angle) * std::cos(azimuth),
                                              0.6 * std::sin(angle) * std::sin(azimuth), 1.0 + 0.6 * std::cos(angle));
  return s;
}
const std::vector<int> kFive = {3, 4, 5, 6, 7};

DetectorResult judge(const test::Scene& s, const Thresholds& tau = {}, const DetectorReadings& readings = {}) {
  return detect_performer(Task::kBend, s.performer, s.partner, tau, readings);
}
DetectorReadings forward() {
  DetectorReadings readings;
  readings.bend_direction = BendDirection::kForward;
  return readings;
}

TEST(BendDetector, NeedsFiveFramesOfTwentyDegrees) {
  EXPECT_TRUE(judge(bow(0.36, kFive)).success);
  EXPECT_FALSE(judge(bow(0.34, kFive)).success);
  const DetectorResult brief = judge(bow(0.36, {3, 4, 5, 6}));
  EXPECT_TRUE(brief.parts.at("angle_condition"));
  EXPECT_FALSE(brief.parts.at("stability_condition"));
  EXPECT_FALSE(brief.success);
}

TEST(BendDetector, ThePrintedRadiansAreNotThePrintedFraction) {
  EXPECT_TRUE(judge(bow(0.4, kFive)).success);
  EXPECT_FALSE(judge(bow(0.4, kFive), {{"min_angle", std::numbers::pi / 6}}).success);
}

TEST(BendDetector, AngleIsMeasuredExactly) {
  for (const double angle : {1e-9, 1e-3, 0.5, 1.5, 3.0})
    EXPECT_NEAR(judge(bow(angle, kFive)).values.at("max_angle"), angle, 1e-12 + 1e-9 * angle);
  test::Scene s = bow(0.0, {});
  s.performer.head = s.performer.root;
  EXPECT_EQ(judge(s).values.at("max_angle"), 0.0);
}

TEST(BendDetector, ThresholdIsIncluded) {
  const test::Scene s = bow(0.5, kFive);
  const double reached = judge(s).values.at("max_angle");
  EXPECT_TRUE(judge(s, {{"min_angle", reached}, {"min_frames", 1}}).success);
  EXPECT_FALSE(judge(s, {{"min_angle", std::nextafter(reached, 4.0)}, {"min_frames", 1}}).success);
}

TEST(BendDetector, FramesReadings) {
  DetectorReadings consecutive;
  consecutive.bend_frames = BendFrames::kConsecutive;
  const test::Scene s = bow(0.5, {1, 3, 5, 6, 7, 9});
  EXPECT_TRUE(judge(s).success);
  EXPECT_FALSE(judge(s, {}, consecutive).success);
  EXPECT_EQ(judge(s, {}, consecutive).values.at("frames_above"), 3.0);
  EXPECT_TRUE(judge(s, {{"min_frames", 3}}, consecutive).success);
  EXPECT_NEAR(judge(s, {{"min_frames", 3}}, consecutive).margins.at("min_angle"), 0.5 - 0.349, 1e-12);
  EXPECT_NEAR(judge(s, {}, consecutive).margins.at("min_angle"), 0.0 - 0.349, 1e-12);
}

TEST(BendDetector, DirectionReadings) {
  const double back = std::numbers::pi;
  EXPECT_TRUE(judge(bow(0.5, kFive, back)).success);
  EXPECT_FALSE(judge(bow(0.5, kFive, back), {}, forward()).success);
  EXPECT_TRUE(judge(bow(0.5, kFive), {}, forward()).success);
  EXPECT_TRUE(judge(bow(0.5, kFive, 1.5), {}, forward()).success);
  EXPECT_FALSE(judge(bow(0.5, kFive, 1.6), {}, forward()).success);
}

TEST(BendDetector, ForwardWithoutThePartnerComesFromTheShoulders) {
  test::Scene s = bow(0.5, kFive);
  s.partner.root.resize(3, 0);
  EXPECT_TRUE(judge(s, {}, forward()).success);
  std::swap(s.performer.lshoulder, s.performer.rshoulder);  // looks the other way
  EXPECT_FALSE(judge(s, {}, forward()).success);
}

// All is relative: neither the place in the room nor the height of the floor tells forwards from backwards.
TEST(BendDetector, DirectionIsTheSameWhereverTheyStand) {
  for (const Eigen::Vector3d& place : {Eigen::Vector3d(9.0, -4.0, 0.0), Eigen::Vector3d(-9.0, 4.0, 2.0)})
    for (const double azimuth : {0.0, std::numbers::pi}) {
      test::Scene s = bow(0.5, kFive, azimuth);
      for (Eigen::Matrix3Xd* track :
           {&s.performer.head, &s.performer.root, &s.performer.lshoulder, &s.performer.rshoulder, &s.partner.root})
        track->colwise() += place;
      EXPECT_EQ(judge(s, {}, forward()).success, azimuth == 0.0) << place.transpose();
      s.partner.root.resize(3, 0);
      EXPECT_EQ(judge(s, {}, forward()).success, azimuth == 0.0) << place.transpose();
    }
}

}  // namespace
}  // namespace duet
