
#include <cmath>
#include <numbers>

#include "duet/metrics/retargeting.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

Eigen::MatrixXd table() {  // 2 joints, 4 frames
  Eigen::MatrixXd m(2, 4);
  m << 0.6, 0.1, 0.9, 0.5,  //
      0.7, 0.2, 0.05, 0.5;
  return m;
}

TEST(LargeAngleRatio, ReadingsOfATable) {
  EXPECT_EQ(large_angle_ratio(table(), LargeAngle::kFrameAny), 0.5);    // frames 0 and 2
  EXPECT_EQ(large_angle_ratio(table(), LargeAngle::kEntry), 0.375);     // 3 of 8
  EXPECT_EQ(large_angle_ratio(table(), LargeAngle::kFrameMean), 0.25);  // 0.65, 0.15, 0.475, 0.5
  EXPECT_EQ(large_angle_ratio(table(), LargeAngle::kFrameAll), 0.25);
  EXPECT_EQ(large_angle_ratio(table(), LargeAngle::kFrameAny, 0.95), 0.0);
}

TEST(LargeAngleRatio, LimitItselfIsNotLarge) {
  const Eigen::MatrixXd half = Eigen::MatrixXd::Constant(3, 5, 0.5);
  for (const LargeAngle reading :
       {LargeAngle::kFrameAny, LargeAngle::kEntry, LargeAngle::kFrameMean, LargeAngle::kFrameAll}) {
    EXPECT_EQ(large_angle_ratio(half, reading), 0.0);
    EXPECT_EQ(large_angle_ratio(half, reading, 0.49), 1.0);
  }
}

TEST(AngleStd, ReadingsOfATable) {
  Eigen::MatrixXd m(2, 2);
  m << 1.0, 3.0,  //
      5.0, 5.0;
  EXPECT_DOUBLE_EQ(angle_std(m), std::sqrt((6.25 + 0.25 + 2.25 + 2.25) / 4));
  EXPECT_DOUBLE_EQ(angle_std(m, AngleStd::kPooled, 1), std::sqrt(11.0 / 3));
  EXPECT_DOUBLE_EQ(angle_std(m, AngleStd::kMeanOfJoints), 0.5);
  EXPECT_DOUBLE_EQ(angle_std(m, AngleStd::kMeanOfJoints, 1), std::sqrt(2.0) / 2);
}

TEST(Magnitudes, HingesAreAbsoluteAngles) {
  Eigen::MatrixXd q(1, 3);
  q << -0.5, 0.0, 2.0;
  EXPECT_EQ(hinge_magnitudes(q), (Eigen::MatrixXd(1, 3) << 0.5, 0.0, 2.0).finished());
}

TEST(Magnitudes, RotationVectorsAreTheirLengths) {
  PointTracks r(1, 2);
  r.at(0, 1) = Eigen::Vector3d(0.3, 0.0, -0.4);
  EXPECT_DOUBLE_EQ(rotvec_magnitudes(r)(1, 0), 0.5);
  EXPECT_EQ(rotvec_magnitudes(r)(0, 0), 0.0);
}

TEST(Magnitudes, GroupsAreOneRotation) {
  Eigen::MatrixXd q(3, 4);
  q << 0.3, 1.0, 0.0, 3.5,   //
      -0.3, 1.0, 1e-9, 0.0,  //
      0.8, 0.0, 0.0, 0.0;
  const HingeGroup parallel{{0, 1}, {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitX()}};
  const HingeGroup crossed{{0, 1}, {Eigen::Vector3d::UnitX(), 2.0 * Eigen::Vector3d::UnitY()}};
  const Eigen::MatrixXd m = grouped_magnitudes(q, {parallel, crossed, {{2}, {Eigen::Vector3d::UnitZ()}}});
  EXPECT_NEAR(m(0, 0), 0.0, 1e-15);  // turns cancel
  EXPECT_NEAR(m(0, 1), 2.0, 1e-15);  // and add
  EXPECT_NEAR(m(1, 0), 2.0 * std::acos(std::cos(0.15) * std::cos(0.15)), 1e-12);
  EXPECT_NEAR(m(1, 1), 2.0 * std::acos(std::cos(0.5) * std::cos(0.5)), 1e-12);
  EXPECT_NEAR(m(0, 2), 1e-9, 1e-20);
  EXPECT_NEAR(m(0, 3), 2.0 * std::numbers::pi - 3.5, 1e-12);  // the shorter way round
  EXPECT_NEAR(m(2, 0), 0.8, 1e-15);
}

TEST(AngleMetrics, RefuseBadInput) {
  const auto of = [](const auto& action) { return test::thrown_message<std::invalid_argument>(action); };
  Eigen::MatrixXd bad = table();
  bad(1, 2) = std::nan("");
  EXPECT_SENTENCE(of([&] { (void)hinge_magnitudes(bad); }));
  EXPECT_SENTENCE(of([&] { (void)large_angle_ratio(bad); }));
  EXPECT_SENTENCE(of([&] { (void)angle_std(Eigen::MatrixXd()); }));
  EXPECT_SENTENCE(of([&] { (void)angle_std(table(), AngleStd::kPooled, 2); }));
  EXPECT_SENTENCE(of([&] { (void)large_angle_ratio(table(), LargeAngle::kEntry, std::nan("")); }));
  EXPECT_SENTENCE(of([&] { (void)grouped_magnitudes(table(), {}); }));
  EXPECT_SENTENCE(of([&] { (void)grouped_magnitudes(table(), {{{0, 1}, {Eigen::Vector3d::UnitX()}}}); }));
  EXPECT_SENTENCE(of([&] { (void)grouped_magnitudes(table(), {{{}, {}}}); }));
  EXPECT_SENTENCE(of([&] { (void)grouped_magnitudes(table(), {{{2}, {Eigen::Vector3d::UnitX()}}}); }));
  EXPECT_SENTENCE(of([&] { (void)grouped_magnitudes(table(), {{{0}, {Eigen::Vector3d::Zero()}}}); }));
  EXPECT_SENTENCE(of([&] { (void)rotvec_magnitudes(PointTracks()); }));
}

}  // namespace
}  // namespace duet
