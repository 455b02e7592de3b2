
#include <limits>

#include "duet/metrics/retargeting.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::random_points;

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

}  // namespace
}  // namespace duet
