#include <cmath>
#include <limits>
#include <numbers>

#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::random_points;

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

constexpr AwdEntries kEntries[] = {AwdEntries::kFull, AwdEntries::kOffdiag, AwdEntries::kCross, AwdEntries::kWithin};

TEST(Jpe, OfARigidShiftIsItsLength) {
  const PointTracks a = random_points(9, 16, 1);
  const Eigen::Vector3d shift(0.3, -0.4, 1.2);
  const PointTracks b = test::transformed(a, [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return p + shift; });
  EXPECT_NEAR(jpe(a, b), 1.3, 1e-14);
  EXPECT_NEAR(jpe(a, b, JpeFrame::kPelvis), 0.0, 1e-14);
  EXPECT_EQ(jpe(a, a), 0.0);
}

TEST(Jpe, IsTheMeanOverFramesAndJoints) {
  const PointTracks a(4, 5);
  PointTracks b = a;
  b.at(2, 3) = Eigen::Vector3d(0.0, 3.0, 4.0);
  EXPECT_DOUBLE_EQ(jpe(a, b), 5.0 / 20);
  EXPECT_DOUBLE_EQ(jpe(b, a), 5.0 / 20);
  b.at(1, 0) = Eigen::Vector3d(1.0, 0.0, 0.0);  // the first point moves all others of its frame
  EXPECT_DOUBLE_EQ(jpe(a, b, JpeFrame::kPelvis), (5.0 + 4.0) / 20);
}

TEST(Jpe, DoesNotDependOnTheWorldFrameOrTimesDirection) {
  const PointTracks a = random_points(6, 16, 2);
  const PointTracks b = random_points(6, 16, 3);
  const Eigen::Quaterniond turn(0.5, -0.5, 0.5, 0.5);
  const auto move = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return turn * p + Eigen::Vector3d(1, 2, 3); };
  const auto grow = [](const Eigen::Vector3d& p) -> Eigen::Vector3d { return 2.5 * p; };
  for (const JpeFrame frame : {JpeFrame::kWorld, JpeFrame::kPelvis}) {
    EXPECT_NEAR(jpe(test::transformed(a, move), test::transformed(b, move), frame), jpe(a, b, frame), 1e-14);
    EXPECT_NEAR(jpe(test::transformed(a, grow), test::transformed(b, grow), frame), 2.5 * jpe(a, b, frame), 1e-14);
  }
}

TEST(Awd, OfARigidMotionOfBothIsZero) {
  const PointTracks a = random_points(5, 7, 4);
  const PointTracks b = random_points(5, 7, 5);
  const Eigen::AngleAxisd turn(0.7, Eigen::Vector3d(1, 2, 3).normalized());
  const auto move = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d { return turn * p + Eigen::Vector3d(1, 2, 3); };
  for (const AwdEntries entries : kEntries)
    EXPECT_NEAR(awd(a, b, test::transformed(a, move), test::transformed(b, move), entries), 0.0, 1e-14);
}

TEST(Awd, CountsByHand) {
  // Two points each: distances 1 within the initiator, 2 within the responder; cross 3, 5 (x) ...
  PointTracks a(1, 2), b(1, 2);
  a.at(0, 1) = Eigen::Vector3d(1, 0, 0);
  b.at(0, 0) = Eigen::Vector3d(3, 0, 0);
  b.at(0, 1) = Eigen::Vector3d(5, 0, 0);
  PointTracks robot = b;
  robot.at(0, 1) = Eigen::Vector3d(6, 0, 0);  // within 2 -> 3, cross 5 -> 6 and 4 -> 5
  EXPECT_DOUBLE_EQ(awd(a, b, a, robot, AwdEntries::kFull), 6.0 / 16);
  EXPECT_DOUBLE_EQ(awd(a, b, a, robot, AwdEntries::kOffdiag), 6.0 / 12);
  EXPECT_DOUBLE_EQ(awd(a, b, a, robot, AwdEntries::kCross), 4.0 / 8);
  EXPECT_DOUBLE_EQ(awd(a, b, a, robot, AwdEntries::kWithin), 2.0 / 4);
}

TEST(Awd, EntriesAddUp) {
  const PointTracks a = random_points(5, 7, 4), b = random_points(5, 7, 5), c = random_points(5, 7, 6),
                    d = random_points(5, 7, 7);
  const auto of = [&](AwdEntries entries) { return awd(a, b, c, d, entries); };
  const double n = 14, k = 7;
  EXPECT_NEAR(of(AwdEntries::kFull), of(AwdEntries::kOffdiag) * (n - 1) / n, 1e-14);
  EXPECT_NEAR(of(AwdEntries::kOffdiag) * n * (n - 1),
              of(AwdEntries::kCross) * 2 * k * k + of(AwdEntries::kWithin) * 2 * k * (k - 1), 1e-12);
  EXPECT_NEAR(awd(c, d, a, b), of(AwdEntries::kFull), 1e-14);  // symmetric in before and after
  EXPECT_NEAR(awd(b, a, d, c), of(AwdEntries::kFull), 1e-14);  // and in the agents
}

TEST(GeometryMetrics, RefuseShapesThatDisagreeAndValuesThatAreNotFinite) {
  const PointTracks a = random_points(4, 3, 1);
  const auto of = [](const auto& action) { return test::thrown_message<std::invalid_argument>(action); };
  EXPECT_SENTENCE(of([&] { (void)jpe(a, random_points(4, 2, 1)); }));
  EXPECT_SENTENCE(of([&] { (void)jpe(a, random_points(3, 3, 1)); }));
  EXPECT_SENTENCE(of([&] { (void)jpe(PointTracks(), a); }));
  PointTracks bad = a;
  bad.at(2, 1).y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(of([&] { (void)jpe(a, bad); }));
  EXPECT_SENTENCE(of([&] { (void)awd(bad, a, a, a); }));
  EXPECT_SENTENCE(of([&] { (void)awd(a, bad, a, a); }));
  EXPECT_SENTENCE(of([&] { (void)awd(a, a, bad, a); }));
  EXPECT_SENTENCE(of([&] { (void)awd(a, a, a, bad); }));
  EXPECT_SENTENCE(of([&] { (void)awd(a, a, a, random_points(4, 4, 1)); }));
}

TEST(Awd, OfOnePointHasNoDistancesWithin) {
  const PointTracks a = random_points(5, 1, 4), b = random_points(5, 1, 5), c = random_points(5, 1, 6);
  EXPECT_EQ(awd(a, b, a, c, AwdEntries::kWithin), 0.0);
  EXPECT_GT(awd(a, b, a, c, AwdEntries::kCross), 0.0);
}

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
