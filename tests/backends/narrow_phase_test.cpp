#include "duet/backends/narrow_phase.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

double distance_by_search(const Eigen::Vector3d& a1, const Eigen::Vector3d& b1, const Eigen::Vector3d& a2,
                          const Eigen::Vector3d& b2) {
  double best = 1e9;
  for (int i = 0; i <= 200; ++i)
    for (int k = 0; k <= 200; ++k)
      best = std::min(best, ((a1 + i / 200.0 * (b1 - a1)) - (a2 + k / 200.0 * (b2 - a2))).norm());
  return best;
}

TEST(NearestPoints, AreAsNearAsASearchFindsThem) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto point = [&] { return Eigen::Vector3d(uniform(random), uniform(random), uniform(random)); };
  for (int trial = 0; trial < 40; ++trial) {
    const Eigen::Vector3d a1 = point(), b1 = point(), a2 = point(), b2 = trial % 8 == 0 ? a2 : point();
    const NearestPoints near = nearest_points(a1, b1, a2, b2);
    const double found = (near.p1 - near.p2).norm(), expected = distance_by_search(a1, b1, a2, b2);
    EXPECT_LE(found, expected + 1e-12);
    EXPECT_GE(found, expected - 0.02);
  }
}

TEST(NearestPoints, OfParallelSegmentsAreInTheMiddleOfTheOverlap) {
  const NearestPoints near = nearest_points({0, 0, 0}, {4, 0, 0}, {6, 1, 0}, {2, 1, 0});
  EXPECT_NEAR(near.p1.x(), 3.0, 1e-12);
  EXPECT_NEAR(near.p2.x(), 3.0, 1e-12);
  const NearestPoints apart = nearest_points({0, 0, 0}, {1, 0, 0}, {5, 1, 0}, {7, 1, 0});
  EXPECT_NEAR(apart.p1.x(), 1.0, 1e-12);
  EXPECT_NEAR(apart.p2.x(), 5.0, 1e-12);
}

TEST(NarrowPhase, FindsTheFourFeetOfASledgeInTheGround) {
  Scene scene;
  scene.robot = test::sledge();
  NarrowPhase narrow_phase(scene);
  Kinematics kinematics(*scene.robot);
  kinematics.update({Eigen::Quaterniond::Identity(), {0, 0, 0.099}}, Eigen::VectorXd::Zero(0));
  const auto points = narrow_phase.collide(kinematics, {});
  ASSERT_EQ(points.size(), 4U);
  for (const ContactPoint& point : points) {
    EXPECT_NEAR(point.depth, 0.001, 1e-12);
    EXPECT_EQ(point.n_W, Eigen::Vector3d::UnitZ());
    EXPECT_EQ(point.friction, scene.friction.robot_ground);
    EXPECT_EQ(point.side, ContactSide::kGround);
  }
}

TEST(NarrowPhase, TouchesAMovingHumanWithItsSkinAndVelocity) {
  Scene scene;
  scene.robot = test::sledge();
  scene.partner = PartnerMode::kSolid;
  scene.human.capsules = {{.name = "arm", .region = "forearm", .joint_a = 0, .joint_b = 1, .radius = 0.05}};
  scene.human.capsules[0].skin = {.stiffness = 1234.0, .damping = 5.0};
  MovingPartner partner;
  HumanJoints joints = HumanJoints::Zero(), velocities = HumanJoints::Zero();
  joints.col(0) = Eigen::Vector3d(0.2 + 0.065, 0.0, 1.02);
  joints.col(1) = Eigen::Vector3d(0.2 + 0.065, 0.4, 1.02);
  velocities.col(0) = velocities.col(1) = Eigen::Vector3d(-0.3, 0.0, 0.0);
  partner.set(joints, velocities);
  NarrowPhase narrow_phase(scene);
  Kinematics kinematics(*scene.robot);
  kinematics.update({Eigen::Quaterniond::Identity(), {0, 0, 1.1}}, Eigen::VectorXd::Zero(0));
  const auto points = narrow_phase.collide(kinematics, partner);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_NEAR((points[0].n_W + Eigen::Vector3d::UnitX()).norm(), 0.0, 1e-9);
  EXPECT_NEAR(points[0].depth, 0.005, 1e-12);
  EXPECT_EQ(points[0].skin.stiffness, 1234.0);
  EXPECT_NEAR(points[0].v_other_W.x(), -0.3, 1e-12);
  EXPECT_EQ(points[0].other, 0);
  EXPECT_EQ(points[0].friction, scene.friction.robot_human);
}

TEST(NarrowPhase, SeesOnlyDeclaredPairsOfTheRobotWithItself) {
  auto robot = test::wheel();
  robot->shapes.resize(2);
  robot->shapes[0].radius = robot->shapes[1].radius = 0.1;
  robot->shapes[1].link = 1;
  robot->shapes[1].X_LS.p = {0.0, 0.15, 0.0};
  Scene scene;
  scene.robot = robot;
  Kinematics kinematics(*robot);
  kinematics.update({Eigen::Quaterniond::Identity(), {0, 0, 2.0}}, Eigen::VectorXd::Zero(1));
  EXPECT_TRUE(NarrowPhase(scene).collide(kinematics, {}).empty());
  robot->self_collision = {{0, 1}};
  NarrowPhase narrow_phase(scene);
  const auto points = narrow_phase.collide(kinematics, {});
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].side, ContactSide::kRobot);
  EXPECT_EQ(points[0].link, 0);
  EXPECT_EQ(points[0].other, 1);
  EXPECT_NEAR(points[0].depth, 0.05, 1e-12);
  EXPECT_NEAR((points[0].n_W + Eigen::Vector3d::UnitY()).norm(), 0.0, 1e-12);
}

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
