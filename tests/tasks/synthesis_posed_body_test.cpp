#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/tasks/synthesis/posed_body.h"
#include "tests/support.h"

namespace duet::synthesis {
namespace {

using Eigen::Vector3d;

Body body_of(double height) { return make_body(height, {1.02, 0.98, 1.05, 0.95}); }

TorsoPose some_torso(Random& random, const Body& body) {
  TorsoPose torso;
  torso.pelvis = {random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), body.stand_height - random.uniform(0.03, 0.1)};
  torso.yaw = random.uniform(-3.1, 3.1);
  torso.pelvis_yaw = random.uniform(-0.1, 0.1);
  torso.pelvis_pitch = random.uniform(0.0, 0.3);
  torso.pelvis_roll = random.uniform(-0.05, 0.05);
  torso.spine_bend = random.uniform(-0.1, 0.6);
  torso.spine_side = random.uniform(-0.1, 0.1);
  torso.twist = random.uniform(-0.4, 0.4);
  torso.look_yaw = random.uniform(-0.8, 0.8);
  return torso;
}

FootPose foot_below(const PosedBody& figure, const Body& body, int side, double pitch) {
  FootPose foot;
  foot.toe = figure.p.col(sided(kLeftHip, side)) + rot_z(figure.yaw) * Vector3d(0.1, 0.0, 0.0);
  foot.toe.z() = body.toe_height();
  foot.yaw = figure.yaw + 0.1 * side_sign(side);
  foot.pitch = pitch;
  return foot;
}

ArmPose arm_to(const PosedBody& figure, const Body& body, int side, double share, Random& random) {
  const Vector3d direction =
      rot_z(figure.yaw) * Vector3d(random.uniform(0.2, 1.0), random.uniform(-0.5, 0.5), random.uniform(-1.0, 0.8));
  ArmPose arm;
  arm.hand = figure.p.col(sided(kLeftShoulder, side)) + share * body.arm() * direction.normalized();
  arm.pole = rot_z(figure.yaw) * Vector3d(-0.5, 0.6 * side_sign(side), -0.4);
  arm.wrist = random.uniform(-0.4, 0.4);
  return arm;
}

double angle(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0));
}

TEST(SynthesisBody, StatureIsTheHeightAskedForWhateverTheProportions) {
  for (const double height : {1.5, 1.73, 1.95}) {
    for (const double legs : {0.975, 1.0, 1.025}) {
      const Body body = make_body(height, {legs, 1.03, 0.94, 1.06});
      double stature = body.ankle_height() + body.leg() - body.offset[kLeftHip].z();
      for (const int joint : {kSpine1, kSpine2, kSpine3, kNeck, kHead}) stature += body.offset[joint].z();
      EXPECT_NEAR(stature + 0.095 * height, height, 1e-12);
      EXPECT_NEAR(body.arm(), 0.382 * 1.03 * height, 1e-12);
    }
  }
}

TEST(SynthesisBody, IsSymmetric) {
  const Body body = body_of(1.7);
  for (int j = 0; j < kSmplJoints; ++j)
    EXPECT_EQ(body.offset[kSmplMirror[j]], Vector3d(body.offset[j].x(), -body.offset[j].y(), body.offset[j].z())) << j;
}

TEST(SynthesisFigure, JointsFollowFromRotationsAndBonesAreExact) {
  Random random(7, 1);
  for (int trial = 0; trial < 50; ++trial) {
    const Body body = body_of(random.uniform(1.5, 1.95));
    PosedBody figure;
    pose_torso(body, some_torso(random, body), figure);
    for (const int side : {0, 1}) {
      pose_leg(body, foot_below(figure, body, side, random.uniform(-0.1, 0.6)), side, figure);
      pose_arm(body, arm_to(figure, body, side, random.uniform(0.3, 1.2), random), side, figure);
    }
    for (int j = 0; j < kSmplJoints; ++j) {
      EXPECT_LT((figure.R[j] * figure.R[j].transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12) << j;
      EXPECT_NEAR(figure.R[j].determinant(), 1.0, 1e-12) << j;
      if (j == kPelvis) continue;
      const Vector3d bone = figure.p.col(j) - figure.p.col(kSmplParents[j]);
      EXPECT_LT((bone - figure.R[kSmplParents[j]] * body.offset[j]).norm(), 1e-14) << j;
      EXPECT_NEAR(bone.norm(), body.offset[j].norm(), 1e-12) << j;
    }
  }
}

TEST(SynthesisFigure, FeetAndHandsWithinReachAreWhereTheyWereSent) {
  Random random(7, 2);
  for (int trial = 0; trial < 50; ++trial) {
    const Body body = body_of(1.7);
    PosedBody figure;
    pose_torso(body, some_torso(random, body), figure);
    for (const int side : {0, 1}) {
      const FootPose foot = foot_below(figure, body, side, 0.2);
      pose_leg(body, foot, side, figure);
      EXPECT_LT((figure.p.col(sided(kLeftToe, side)) - foot.toe).norm(), 1e-12);
      const ArmPose arm = arm_to(figure, body, side, random.uniform(0.5, 0.93), random);
      pose_arm(body, arm, side, figure);
      EXPECT_LT((figure.p.col(sided(kLeftHand, side)) - arm.hand).norm(), 1e-12);
    }
  }
}

TEST(SynthesisFigure, ElbowsPointToThePoleKneesForward) {
  Random random(7, 3);
  const Body body = body_of(1.8);
  for (int trial = 0; trial < 50; ++trial) {
    PosedBody figure;
    pose_torso(body, some_torso(random, body), figure);
    for (const int side : {0, 1}) {
      pose_leg(body, foot_below(figure, body, side, 0.1), side, figure);
      const Vector3d hip = figure.p.col(sided(kLeftHip, side)), knee = figure.p.col(sided(kLeftKnee, side)),
                     ankle = figure.p.col(sided(kLeftAnkle, side));
      EXPECT_GT((knee - 0.5 * (hip + ankle)).dot(figure.R[kPelvis].col(0)), 0.0);
      const ArmPose arm = arm_to(figure, body, side, 0.7, random);
      pose_arm(body, arm, side, figure);
      const Vector3d shoulder = figure.p.col(sided(kLeftShoulder, side)), elbow = figure.p.col(sided(kLeftElbow, side));
      EXPECT_GT((elbow - 0.5 * (shoulder + arm.hand)).dot(arm.pole), 0.0);
    }
  }
}

TEST(SynthesisFigure, WristBendsByTheAngleGivenInTheElbowsPlane) {
  Random random(7, 4);
  const Body body = body_of(1.7);
  for (const double wrist : {-0.5, 0.0, 0.3, 0.8}) {
    PosedBody figure;
    pose_torso(body, some_torso(random, body), figure);
    ArmPose arm = arm_to(figure, body, 1, 0.7, random);
    arm.wrist = wrist;
    pose_arm(body, arm, 1, figure);
    const Vector3d upper = figure.p.col(kRightElbow) - figure.p.col(kRightShoulder);
    const Vector3d fore = figure.p.col(kRightWrist) - figure.p.col(kRightElbow);
    const Vector3d hand = figure.p.col(kRightHand) - figure.p.col(kRightWrist);
    EXPECT_NEAR(angle(fore, hand), std::abs(wrist), 1e-7);
    EXPECT_NEAR(upper.cross(fore).normalized().dot(hand), 0.0, 1e-12);
    EXPECT_GE(wrist * upper.cross(fore).dot(fore.cross(hand)), 0.0);
  }
}

TEST(SynthesisFigure, AnArmNeverLocksHoweverFarTheTarget) {
  const Body body = body_of(1.7);
  PosedBody figure;
  pose_torso(body, {}, figure);
  double last = 0.0;
  for (double share = 0.05; share < 3.0; share += 0.01) {
    ArmPose arm;
    arm.hand = figure.p.col(kLeftShoulder) + share * body.arm() * Vector3d::UnitX();
    arm.pole = -Vector3d::UnitZ();
    pose_arm(body, arm, 0, figure);
    const double reach = (figure.p.col(kLeftHand) - figure.p.col(kLeftShoulder)).norm();
    EXPECT_LT(reach, 0.9951 * body.arm());
    EXPECT_GE(reach, last - 1e-9);
    last = reach;
  }
}

TEST(SynthesisFigure, BothSidesAreMirrorImages) {
  const Body body = body_of(1.7);
  PosedBody figure;
  pose_torso(body, {.pelvis = {0.0, 0.0, 0.9}, .pelvis_pitch = 0.2, .spine_bend = 0.3}, figure);
  for (const int side : {0, 1}) {
    const double sign = side_sign(side);
    pose_leg(body, {{0.1, sign * 0.1, body.toe_height()}, sign * 0.1, 0.1}, side, figure);
    pose_arm(body, {{0.5, sign * 0.1, 1.2}, {-0.3, sign * 0.5, -1.0}, 0.3}, side, figure);
  }
  for (int j = 0; j < kSmplJoints; ++j) {
    const Vector3d p = figure.p.col(j), q = figure.p.col(kSmplMirror[j]);
    EXPECT_LT((p - Vector3d(q.x(), -q.y(), q.z())).norm(), 1e-12) << j;
  }
}

}  // namespace
}  // namespace duet::synthesis
