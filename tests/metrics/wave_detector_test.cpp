#include <gtest/gtest.h>

#include <numbers>

#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kFrames = 41;
constexpr int kPeriod = 20;  // frames there and back

// The right hand 0.6 m over the root swings `swing` along `axis` in a triangle wave: there, back, there, back.
test::Scene wave(double swing, const Eigen::Vector3d& axis, double height = 0.6) {
  test::Scene s{test::standing({0.0, 0.0, 1.0}, 1.0, kFrames), test::standing({2.0, 0.0, 1.0}, -1.0, kFrames)};
  for (int t = 0; t < kFrames; ++t) {
    const int phase = t % kPeriod;
    const double share = phase <= kPeriod / 2 ? phase / 10.0 : (kPeriod - phase) / 10.0;
    s.performer.rhand.col(t) = Eigen::Vector3d(0.2, -0.3, 1.0 + height) + swing * share * axis;
  }
  return s;
}
const Eigen::Vector3d kSideways = Eigen::Vector3d::UnitY();

DetectorResult judge(const test::Scene& s, const Thresholds& tau = {}, const DetectorReadings& readings = {}) {
  return detect_performer(Task::kWave, s.performer, s.partner, tau, readings);
}

TEST(WaveDetector, ASwingingHandWaves) {
  const DetectorResult result = judge(wave(0.4, kSideways));
  EXPECT_TRUE(result.success);
  EXPECT_NEAR(result.values.at("motion_total"), 1.6, 1e-12);
  EXPECT_EQ(result.values.at("direction_changes"), 3.0);
  EXPECT_NEAR(result.values.at("amplitude"), 0.4, 1e-12);
  EXPECT_NEAR(result.values.at("height"), 0.6, 1e-12);
  for (int t = 0; t < kFrames; ++t) EXPECT_EQ(result.frames[t], t == 10 || t == 20 || t == 30) << t;
}

TEST(WaveDetector, EachPartCanFail) {
  const auto part = [](const test::Scene& s, const char* name, const Thresholds& tau = {}) {
    return judge(s, tau).parts.at(name);
  };
  EXPECT_FALSE(part(wave(0.1, kSideways), "motion_sufficient"));
  EXPECT_FALSE(part(wave(0.29, kSideways), "amplitude_check"));
  EXPECT_FALSE(part(wave(0.4, kSideways, 0.44), "height_check"));
  EXPECT_FALSE(part(wave(0.4, kSideways), "direction_changes", {{"min_changes", 4}}));
  EXPECT_FALSE(judge(wave(0.4, kSideways), {{"min_changes", 4}}).success);
}

TEST(WaveDetector, Boundaries) {
  const test::Scene s = wave(0.5, kSideways, 0.5);  // exact in binary: total 2, amplitude 0.5, height 0.5
  const auto part = [&](const char* name, const Thresholds& tau) { return judge(s, tau).parts.at(name); };
  EXPECT_TRUE(part("amplitude_check", {{"amplitude", judge(s).values.at("amplitude")}}));
  EXPECT_TRUE(part("height_check", {{"height", 0.5}}));
  EXPECT_FALSE(part("motion_sufficient", {{"motion_dist", judge(s).values.at("motion_total")}}));
  EXPECT_TRUE(part("direction_changes", {{"angle", 3.14}}));
  EXPECT_FALSE(part("direction_changes", {{"angle", std::numbers::pi}}));  // a turn of exactly pi is not more
}

TEST(WaveDetector, TheHandThatMovesFartherWavesAndTiesGoRight) {
  test::Scene s = wave(0.4, kSideways);
  s.performer.lhand = s.performer.rhand;
  for (int t = 0; t < kFrames; ++t) s.performer.lhand(2, t) -= 0.5;
  DetectorReadings active;
  active.wave_height = WaveHeight::kActiveMax;
  EXPECT_NEAR(judge(s, {}, active).values.at("height"), 0.6, 1e-12);
  s.performer.lhand(0, kFrames - 1) += 0.5;
  EXPECT_NEAR(judge(s, {}, active).values.at("height"), 0.1, 1e-12);
}

// The turn from +3 rad to -3 rad is 0.28 rad, not 6.
TEST(WaveDetector, TurnsAreTakenTheShortWay) {
  test::Scene s = wave(0.0, kSideways);
  for (int t = 0; t < kFrames; ++t)
    s.performer.rhand.col(t) += Eigen::Vector3d(-0.1 * t, t % 2 == 0 ? 0.0 : 0.014, 0.0);
  EXPECT_EQ(judge(s).values.at("direction_changes"), 0.0);
  EXPECT_EQ(judge(s, {{"angle", 0.27}}).values.at("direction_changes"), kFrames - 2.0);
}

TEST(WaveDetector, PlaneReadings) {
  const auto changes = [](const Eigen::Vector3d& axis, WavePlane plane) {
    DetectorReadings readings;
    readings.wave_plane = plane;
    return judge(wave(0.4, axis), {}, readings).values.at("direction_changes");
  };
  // Up and down: the floor plane sees nothing move (all angles 0), the frontal plane does.
  EXPECT_EQ(changes(Eigen::Vector3d::UnitZ(), WavePlane::kXy), 0.0);
  EXPECT_EQ(changes(Eigen::Vector3d::UnitZ(), WavePlane::kLateralUp), 3.0);
  EXPECT_EQ(changes(Eigen::Vector3d::UnitZ(), WavePlane::kPca), 3.0);
  // Towards the partner: only the floor plane and the principal plane see it.
  EXPECT_EQ(changes(Eigen::Vector3d::UnitX(), WavePlane::kXy), 3.0);
  EXPECT_EQ(changes(Eigen::Vector3d::UnitX(), WavePlane::kLateralUp), 0.0);
  EXPECT_EQ(changes(Eigen::Vector3d::UnitX(), WavePlane::kPca), 3.0);
}

TEST(WaveDetector, LateralPlaneFromShouldersAndUndefined) {
  DetectorReadings frontal;
  frontal.wave_plane = WavePlane::kLateralUp;
  test::Scene s = wave(0.4, kSideways);
  s.partner.root.resize(3, 0);
  EXPECT_EQ(judge(s, {}, frontal).values.at("direction_changes"), 3.0);
  s.partner.root = s.performer.root;  // no direction to the partner
  EXPECT_FALSE(judge(s, {}, frontal).parts.at("direction_changes"));
}

TEST(WaveDetector, DisplacementReadings) {
  const auto changes = [](const test::Scene& s, WaveDisplacement displacement, double threshold) {
    DetectorReadings readings;
    readings.wave_displacement = displacement;
    return judge(s, {{"displacement", threshold}}, readings).values.at("direction_changes");
  };
  // Every step is 4 cm; the first turn comes 40 cm from the start, as does each from the one before.
  const test::Scene s = wave(0.4, kSideways);
  EXPECT_EQ(changes(s, WaveDisplacement::kStep, 0.039), 3.0);
  EXPECT_EQ(changes(s, WaveDisplacement::kStep, 0.041), 0.0);
  EXPECT_EQ(changes(s, WaveDisplacement::kBothSteps, 0.039), 3.0);
  EXPECT_EQ(changes(s, WaveDisplacement::kSinceLast, 0.39), 3.0);
  EXPECT_EQ(changes(s, WaveDisplacement::kSinceLast, 0.41), 0.0);
  EXPECT_EQ(changes(s, WaveDisplacement::kNone, 10.0), 3.0);

  test::Scene slow = s;  // the step before the first turn is short, the one after it long
  slow.performer.rhand.col(9) += 0.99 * (slow.performer.rhand.col(10) - slow.performer.rhand.col(9)).eval();
  EXPECT_EQ(changes(slow, WaveDisplacement::kStep, 0.005), 3.0);
  EXPECT_EQ(changes(slow, WaveDisplacement::kBothSteps, 0.005), 2.0);
}

TEST(WaveDetector, AmplitudeReadings) {
  const auto extent = [](const Eigen::Vector3d& axis, WaveAmplitude amplitude) {
    DetectorReadings readings;
    readings.wave_amplitude = amplitude;
    return judge(wave(1.0, axis), {}, readings).values.at("amplitude");
  };
  const Eigen::Vector3d slanted(0.3, 0.4, 1.2);
  EXPECT_NEAR(extent(slanted, WaveAmplitude::kMaxAxis), 1.2, 1e-12);
  EXPECT_NEAR(extent(slanted, WaveAmplitude::kDiagonal), 1.3, 1e-12);
  EXPECT_NEAR(extent(slanted, WaveAmplitude::kDiameter), 1.3, 1e-12);
  EXPECT_NEAR(extent(slanted, WaveAmplitude::kHorizontal), 0.5, 1e-12);
  // A corner: the box's diagonal is longer than any distance between two points.
  test::Scene s = wave(0.0, kSideways);
  s.performer.rhand.col(1) += Eigen::Vector3d(3.0, 0.0, 0.0);
  s.performer.rhand.col(2) += Eigen::Vector3d(0.0, 4.0, 0.0);
  s.performer.rhand.col(3) += Eigen::Vector3d(0.0, 0.0, 1.0);
  DetectorReadings readings;
  readings.wave_amplitude = WaveAmplitude::kDiagonal;
  EXPECT_NEAR(judge(s, {}, readings).values.at("amplitude"), std::sqrt(26.0), 1e-12);
  readings.wave_amplitude = WaveAmplitude::kDiameter;
  EXPECT_NEAR(judge(s, {}, readings).values.at("amplitude"), 5.0, 1e-12);
}

TEST(WaveDetector, HeightReadings) {
  test::Scene s = wave(0.4, kSideways, 0.0);
  for (int t = 0; t < 11; ++t) s.performer.rhand(2, t) += 0.5;  // 11 of 41 frames
  s.performer.lhand(2, 40) = 1.9;
  const auto height = [&](WaveHeight reading) {
    DetectorReadings readings;
    readings.wave_height = reading;
    return judge(s, {}, readings).values.at("height");
  };
  EXPECT_NEAR(height(WaveHeight::kAnyHandMax), 0.9, 1e-12);
  EXPECT_NEAR(height(WaveHeight::kActiveMax), 0.5, 1e-12);
  EXPECT_NEAR(height(WaveHeight::kActiveMean), 0.5 * 11 / 41, 1e-12);
  EXPECT_NEAR(height(WaveHeight::kActiveMedian), 0.0, 1e-12);
}

TEST(WaveDetector, FrameReadings) {
  test::Scene s = wave(0.0, kSideways);
  for (Eigen::Matrix3Xd* track : {&s.performer.root, &s.performer.rhand, &s.performer.lhand})
    for (int t = 0; t < kFrames; ++t) (*track)(0, t) += 0.05 * t;  // walks 2 m
  DetectorReadings root;
  root.wave_frame = MotionFrame::kRoot;
  EXPECT_NEAR(judge(s).values.at("motion_total"), 2.0, 1e-12);
  EXPECT_NEAR(judge(s, {}, root).values.at("motion_total"), 0.0, 1e-12);
  EXPECT_NEAR(judge(s, {}, root).values.at("height"), 0.6, 1e-12);
}

// The hand is at 0.6 m over the root but for the frames named.
TEST(WaveDetector, MedianHeightIsTheMiddleOneOrTheMeanOfTheTwoInTheMiddle) {
  DetectorReadings median;
  median.wave_height = WaveHeight::kActiveMedian;
  const auto height = [&](const std::vector<double>& heights) {
    const auto frames = static_cast<int>(heights.size());
    test::Scene s{test::standing({0.0, 0.0, 1.0}, 1.0, frames), test::standing({2.0, 0.0, 1.0}, -1.0, frames)};
    for (int t = 0; t < frames; ++t) s.performer.rhand.col(t) = Eigen::Vector3d(0.1 * t, 0.0, 1.0 + heights[t]);
    return judge(s, {}, median).values.at("height");
  };
  EXPECT_NEAR(height({0.9, 0.1, 0.5}), 0.5, 1e-12);
  EXPECT_NEAR(height({0.9, 0.1, 0.5, 0.7}), 0.6, 1e-12);
  EXPECT_NEAR(height({0.1, 0.2, 0.3, 0.9, 1.0, 1.1}), 0.6, 1e-12);
}

}  // namespace
}  // namespace duet
