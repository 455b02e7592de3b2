
#include <cmath>

#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kRate = 50.0;
// Third differences at 50 Hz magnify rounding by 8 rate^3.
constexpr double kTolerance = 8 * 125000 * 1e-15;

PointTracks cubic(int frames, const Eigen::Vector3d& c) {
  return test::path(frames, [&](int t) -> Eigen::Vector3d {
    const double s = t / kRate;
    return c * s * s * s / 6.0 + Eigen::Vector3d(1.0, s, s * s);
  });
}

TEST(Jerk, OfACubicIsExact) {
  const PointTracks p = cubic(30, {2.0, -1.0, 2.0});
  for (const JerkScheme scheme : {JerkScheme::kDiff, JerkScheme::kCentral}) {
    const Jerk j = jerk(p, kRate, scheme);
    EXPECT_NEAR(j.mean, 3.0, kTolerance);
    EXPECT_NEAR(j.std, 0.0, kTolerance);
  }
}

// numpy.gradient three times is exact away from three frames at either end.
TEST(Jerk, GradientIsExactInside) {
  Eigen::MatrixXd x(1, 20);
  for (int t = 0; t < 20; ++t) x(0, t) = std::pow(t / kRate, 3);
  const Eigen::MatrixXd third = third_derivative(x, kRate, JerkScheme::kGradient);
  ASSERT_EQ(third.cols(), 20);
  for (int t = 3; t < 17; ++t) EXPECT_NEAR(third(0, t), 6.0, kTolerance);
  EXPECT_GT(std::abs(third(0, 0) - 6.0), 0.1);
}

TEST(Jerk, GradientIsNumpys) {
  Eigen::MatrixXd x(1, 5);
  x << 1.0, 2.0, 4.0, 7.0, 11.0;
  EXPECT_EQ(gradient(x, 1.0), (Eigen::MatrixXd(1, 5) << 1.0, 1.5, 2.5, 3.5, 4.0).finished());
  EXPECT_EQ(gradient(x.leftCols(2), 2.0), (Eigen::MatrixXd(1, 2) << 2.0, 2.0).finished());
}

TEST(Jerk, SchemesByHand) {
  const PointTracks p = test::path(5, [](int t) { return Eigen::Vector3d(t == 2 ? 1.0 : 0.0, 0.0, 0.0); });
  // diff: x = 0 0 1 0 0 -> -3, 3; central at t = 2: 0.
  EXPECT_DOUBLE_EQ(jerk(p, 1.0).mean, 3.0);
  EXPECT_DOUBLE_EQ(jerk(p, 2.0).mean, 24.0);
  EXPECT_DOUBLE_EQ(jerk(p, 1.0, JerkScheme::kCentral).mean, 0.0);
  // gradient: 0 .5 0 -.5 0 -> .5 0 -.5 0 .5 -> -.5 -.5 0 .5 .5
  EXPECT_DOUBLE_EQ(jerk(p, 1.0, JerkScheme::kGradient).mean, 0.4);
}

TEST(Jerk, IsPooledOverFramesAndJoints) {
  PointTracks p(4, 2);  // one jerk sample of each joint: 6 and 0
  p.at(3, 0) = Eigen::Vector3d(0.0, 6.0, 0.0);
  EXPECT_DOUBLE_EQ(jerk(p, 1.0).mean, 3.0);
  EXPECT_DOUBLE_EQ(jerk(p, 1.0).std, 3.0);
  EXPECT_DOUBLE_EQ(jerk(p, 1.0, JerkScheme::kDiff, 1).std, std::sqrt(18.0));
  EXPECT_TRUE(std::isnan(jerk(p.select({0}), 1.0, JerkScheme::kDiff, 1).std));  // one sample has no deviation
}

TEST(Jerk, DoesNotDependOnTheWorldFrameOrTimesDirection) {
  const PointTracks p = test::random_points(12, 3, 9);
  const Eigen::AngleAxisd turn(0.8, Eigen::Vector3d(1, 1, 0).normalized());
  PointTracks back = p;
  for (int t = 0; t < 12; ++t) back.frame(t) = p.frame(11 - t);
  const PointTracks moved = test::transformed(
      p, [&](const Eigen::Vector3d& x) -> Eigen::Vector3d { return turn * x + Eigen::Vector3d(5, 6, 7); });
  for (const JerkScheme scheme : {JerkScheme::kDiff, JerkScheme::kCentral, JerkScheme::kGradient}) {
    EXPECT_NEAR(jerk(moved, 1.0, scheme).mean, jerk(p, 1.0, scheme).mean, 1e-12);
    EXPECT_NEAR(jerk(back, 1.0, scheme).std, jerk(p, 1.0, scheme).std, 1e-12);
  }
}

TEST(Jerk, RefusesBadInput) {
  const auto of = [](const auto& action) { return test::thrown_message<std::invalid_argument>(action); };
  const PointTracks four = test::random_points(4, 1, 1);
  EXPECT_SENTENCE(of([&] { (void)jerk(four.slice(0, 3), kRate); }));
  EXPECT_SENTENCE(of([&] { (void)jerk(four, kRate, JerkScheme::kCentral); }));
  EXPECT_SENTENCE(of([&] { (void)jerk(four, 0.0); }));
  EXPECT_SENTENCE(of([&] { (void)jerk(four, std::nan("")); }));
  EXPECT_SENTENCE(of([&] { (void)jerk(four, kRate, JerkScheme::kDiff, 3); }));
  EXPECT_SENTENCE(of([&] { (void)jerk(PointTracks(), kRate); }));
  EXPECT_NO_THROW((void)jerk(four, kRate, JerkScheme::kGradient));
}

}  // namespace
}  // namespace duet
