#include <numbers>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/robot_state.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kAlgebra = 64 * std::numeric_limits<double>::epsilon();  // a few products of numbers near 1

std::vector<Pose> nasty_poses() {
  std::vector<Pose> poses = {{}};
  for (const double angle : {0.0, 1e-9, 1.0, std::numbers::pi - 1e-9, std::numbers::pi})
    for (const Eigen::Vector3d& axis : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 2, 3).normalized().eval()})
      poses.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), {angle, -1.0, 2.0}});
  Random random(1, 2);
  for (int i = 0; i < 20; ++i) {
    Eigen::Quaterniond R(random.normal(), random.normal(), random.normal(), random.normal());
    poses.push_back({R.normalized(), {random.normal(), random.normal(), random.normal()}});
    poses.push_back({Eigen::Quaterniond(-poses.back().R.coeffs()), poses.back().p});
  }
  return poses;
}

TEST(Pose, InverseTakesBack) {
  for (const Pose& X : nasty_poses()) {
    const Pose identity = X * X.inverse();
    EXPECT_NEAR(identity.p.norm(), 0.0, kAlgebra);
    EXPECT_NEAR(std::abs(identity.R.w()), 1.0, kAlgebra);
  }
}

TEST(Pose, ProductActsAsOneAfterTheOther) {
  const std::vector<Pose> poses = nasty_poses();
  const Eigen::Vector3d point(0.3, -0.7, 1.1);
  for (const Pose& a : poses)
    for (const Pose& b : poses) EXPECT_NEAR(((a * b) * point - a * (b * point)).norm(), 0.0, kAlgebra);
}

TEST(Pose, InterpolationMeetsItsEnds) {
  const std::vector<Pose> poses = nasty_poses();
  for (const Pose& a : poses)
    for (const Pose& b : poses) {
      EXPECT_NEAR(interpolate(a, b, 0.0).R.angularDistance(a.R), 0.0, 1e-7);  // arccos near 1: sqrt(epsilon)
      EXPECT_NEAR(interpolate(a, b, 1.0).R.angularDistance(b.R), 0.0, 1e-7);
      EXPECT_NEAR((interpolate(a, b, 0.25).p - (0.75 * a.p + 0.25 * b.p)).norm(), 0.0, kAlgebra);
    }
}

TEST(Pose, InterpolationTakesTheShorterArc) {
  const Pose a;
  Pose b{yaw_rotation(1.0), Eigen::Vector3d::Zero()};
  b.R.coeffs() *= -1.0;  // the same rotation, on the far side of the sphere
  EXPECT_NEAR(yaw_of(interpolate(a, b, 0.5).R), 0.5, kAlgebra);
}

TEST(Pose, YawIsTheHeading) {
  for (const double yaw : {-3.0, -1e-9, 0.0, 1.0, 3.1}) {
    EXPECT_NEAR(yaw_of(yaw_rotation(yaw)), yaw, kAlgebra);
    const Eigen::Quaterniond pitched = yaw_rotation(yaw) * Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY());
    EXPECT_NEAR(yaw_of(pitched), yaw, kAlgebra);
  }
}

}  // namespace
}  // namespace duet
