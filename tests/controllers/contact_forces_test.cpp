#include "duet/controllers/vmc.h"
#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kMu = 0.6;

bool inside(const Eigen::Vector3d& f, double slack = 1e-12) {
  return f.z() >= -slack && std::abs(f.x()) <= kMu * f.z() + slack && std::abs(f.y()) <= kMu * f.z() + slack;
}

Eigen::Vector3d random_vector(Random& random) { return {random.normal(), random.normal(), random.normal()}; }

TEST(Pyramid, KeepsWhatIsInsideAndGivesTheTipForThePolarCone) {
  EXPECT_EQ(project_on_pyramid({0.3, -0.5, 1.0}, kMu), Eigen::Vector3d(0.3, -0.5, 1.0));
  EXPECT_EQ(project_on_pyramid({0.0, 0.0, -1.0}, kMu), Eigen::Vector3d::Zero());
  EXPECT_EQ(project_on_pyramid({0.0, 0.0, 0.0}, kMu), Eigen::Vector3d::Zero());
  EXPECT_EQ(project_on_pyramid({0.1, 0.1, -1.0}, kMu), Eigen::Vector3d::Zero());
}

// The projection on a closed convex set is the point whose offset makes no acute angle with any way into the set.
TEST(Pyramid, ProjectionIsTheNearestPoint) {
  Random random(3, 1);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d f = random_vector(random);
    const Eigen::Vector3d nearest = project_on_pyramid(f, kMu);
    ASSERT_TRUE(inside(nearest));
    for (int k = 0; k < 20; ++k) {
      const Eigen::Vector3d other = project_on_pyramid(3.0 * random_vector(random), kMu);
      EXPECT_LE((f - nearest).dot(other - nearest), 1e-12);
    }
  }
}

// Two soles of four points each, unit inertia about a point 0.7 m above.
Matrix6Xd soles(double y_of_second) {
  Matrix6Xd G(6, 24);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d p(i % 2 == 0 ? -0.08 : 0.08, (i < 4 ? 0.1 : y_of_second) + (i % 4 < 2 ? -0.03 : 0.03), -0.7);
    G.block<3, 3>(0, 3 * i) = Eigen::Matrix3d::Identity() / 33.0;
    G.block<3, 3>(3, 3 * i) << 0.0, -p.z(), p.y(), p.z(), 0.0, -p.x(), -p.y(), p.x(), 0.0;
    G.block<3, 3>(3, 3 * i) /= 3.0;
  }
  return G;
}

Eigen::VectorXd even() {
  Eigen::VectorXd f = Eigen::VectorXd::Zero(24);
  for (int i = 0; i < 8; ++i) f[3 * i + 2] = 33.0 * 9.81 / 8;
  return f;
}

TEST(ContactForces, FeasibleMotionIsReached) {
  ContactForces forces(8, kMu, 1e-6, 120);
  forces.restart(even());
  Vector6d b;
  b << 0.5, -0.3, 9.81, 0.0, 0.0, 0.0;
  b.segment<3>(3) << -0.3 * 0.7 * 11.0, -0.5 * 0.7 * 11.0, 0.0;  // what those forces make about the centre at no cost
  const Matrix6Xd G = soles(-0.1);
  const Eigen::VectorXd& f = forces.solve(G, b, Vector6d::Ones(), even());
  EXPECT_LT((G * f - b).norm(), 0.02 * b.norm());
}

TEST(ContactForces, NeverPullOrSlipAndRepeatBitwise) {
  Random random(5, 1);
  for (int trial = 0; trial < 50; ++trial) {
    Vector6d b;
    for (double& value : b) value = 10.0 * random.normal();
    ContactForces first(8, kMu, 1e-6, 120), second(8, kMu, 1e-6, 120);
    first.restart(even());
    second.restart(even());
    const Eigen::VectorXd f = first.solve(soles(-0.1), b, Vector6d::Ones(), even());
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(inside(f.segment<3>(3 * i)));
    EXPECT_EQ(f, second.solve(soles(-0.1), b, Vector6d::Ones(), even()));
  }
}

TEST(ContactForces, CenterOfPressureStopsAtTheEdge) {
  ContactForces forces(8, kMu, 1e-6, 400);
  forces.restart(even());
  Vector6d b;
  b << 0.0, 0.0, 9.81, 0.0, -100.0, 0.0;  // far more moment than the soles' length gives
  const Eigen::VectorXd& f = forces.solve(soles(-0.1), b, Vector6d::Ones(), even());
  double total = 0.0, moment = 0.0;
  for (int i = 0; i < 8; ++i) {
    total += f[3 * i + 2];
    moment += f[3 * i + 2] * (i % 2 == 0 ? -0.08 : 0.08);
  }
  EXPECT_NEAR(moment / total, 0.08, 1e-3);
}

}  // namespace
}  // namespace duet
