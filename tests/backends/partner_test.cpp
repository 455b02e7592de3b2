#include "duet/backends/narrow_phase.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kAlgebra = 1e-14;

HumanCapsule forearm() {
  HumanCapsule capsule;
  capsule.joint_a = 18;
  capsule.joint_b = 20;
  capsule.radius = 0.04;
  return capsule;
}

TEST(Partner, CapsuleLiesBetweenItsJoints) {
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(0, 0, 0.3), Eigen::Vector3d(0, 0, -0.3),
                                      Eigen::Vector3d(0.1, -0.2, 0.2), Eigen::Vector3d(1e-9, 0, -0.3)}) {
    HumanJoints joints = HumanJoints::Zero();
    joints.col(18) = Eigen::Vector3d(1.0, 2.0, 3.0);
    joints.col(20) = joints.col(18) + axis;
    const CapsulePose pose = capsule_pose(forearm(), joints);
    const Eigen::Vector3d tip = pose.X_WC * Eigen::Vector3d(0.0, 0.0, pose.half_length);
    EXPECT_NEAR((tip - joints.col(20)).norm(), 0.0, 1e-9) << axis.transpose();
    EXPECT_NEAR(pose.X_WC.R.norm(), 1.0, kAlgebra);
  }
}

TEST(Partner, CapsuleOfJointsInOnePlaceIsASphere) {
  const CapsulePose pose = capsule_pose(forearm(), HumanJoints::Ones());
  EXPECT_EQ(pose.half_length, 0.0);
  EXPECT_EQ(pose.X_WC.p, Eigen::Vector3d::Ones());
  EXPECT_TRUE(pose.X_WC.R.coeffs().allFinite());
}

TEST(Partner, VelocityIsLinearAlongTheCapsuleAndConstantBeyondItsEnds) {
  MovingPartner partner;
  partner.joints.col(20) = Eigen::Vector3d(0.4, 0.0, 0.0);
  partner.velocities.col(18) = Eigen::Vector3d(0.0, 1.0, 0.0);
  partner.velocities.col(20) = Eigen::Vector3d(0.0, 3.0, 0.0);
  const auto speed = [&](double x) { return capsule_velocity(forearm(), partner, {x, 0.05, 0.0}).y(); };
  EXPECT_NEAR(speed(0.0), 1.0, kAlgebra);
  EXPECT_NEAR(speed(0.1), 1.5, kAlgebra);
  EXPECT_NEAR(speed(0.4), 3.0, kAlgebra);
  EXPECT_NEAR(speed(-1.0), 1.0, kAlgebra);
  EXPECT_NEAR(speed(1.0), 3.0, kAlgebra);
}

TEST(Partner, MovesOnAtItsVelocitiesAndReturnsFromItsNumbers) {
  MovingPartner partner;
  partner.set(HumanJoints::Ones(), HumanJoints::Constant(2.0));
  partner.advance(0.25);
  EXPECT_EQ(partner.joints, HumanJoints::Constant(1.5));
  std::vector<double> values;
  partner.append_to(values);
  ASSERT_EQ(values.size(), static_cast<size_t>(MovingPartner::kValues));
  MovingPartner read;
  read.read_from(values);
  EXPECT_TRUE(read.present);
  EXPECT_EQ(read.joints, partner.joints);
  EXPECT_EQ(read.velocities, partner.velocities);
}

}  // namespace
}  // namespace duet
