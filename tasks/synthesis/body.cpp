#include "duet/tasks/synthesis/body.h"

namespace duet::synthesis {
namespace {

// Fractions of the stature. Limbs: Drillis and Contini (1966) as in Winter, "Biomechanics and Motor Control of Human
// Movement", fig. 4.1; where SMPL's joints are no segment ends (spine, collars, hand = knuckles), SMPL's mean shape.
constexpr double kThigh = 0.245, kShank = 0.246, kAnkle = 0.039;
constexpr double kToeForward = 0.072, kToeHeight = 0.012;
constexpr double kUpperArm = 0.186, kForearm = 0.146, kHand = 0.05;
constexpr double kHipDrop = 0.03, kHipSide = 0.05, kHipBack = 0.005;
constexpr double kHeadTop = 0.095;  // above the head joint
constexpr double kTrunk = 1.0 - kThigh - kShank - kAnkle - kHipDrop - kHeadTop;
constexpr double kTorsoRadius = 0.072;
// Leg extension in quiet standing: 2 acos(0.996) = 10 degrees of knee flexion.
constexpr double kStandExtension = 0.996;

struct SpineBone {
  SmplJoint joint;
  double forward, left, up;  // of the stature
};
constexpr std::array<SpineBone, 5> kSpine = {{{kSpine1, -0.012, 0.0, 0.062},
                                              {kSpine2, 0.006, 0.0, 0.078},
                                              {kSpine3, 0.002, 0.0, 0.035},
                                              {kNeck, -0.012, 0.0, 0.118},
                                              {kHead, 0.022, 0.0, 0.048}}};
constexpr double kSpineSum = 0.062 + 0.078 + 0.035 + 0.118 + 0.048;

void set_pair(Body& body, SmplJoint left, const Eigen::Vector3d& offset) {
  body.offset[left] = offset;
  body.offset[kSmplMirror[left]] = {offset.x(), -offset.y(), offset.z()};
}

}  // namespace

double Body::toe_height() const { return kToeHeight * height; }
double Body::ankle_height() const { return toe_height() - offset[kLeftToe].z(); }

Body make_body(double height, const Proportions& proportions) {
  const double h = height;
  Body body;
  body.height = h;
  body.thigh = kThigh * proportions.legs * h;
  body.shank = kShank * proportions.legs * h;
  body.upper_arm = kUpperArm * proportions.arms * h;
  body.forearm = kForearm * proportions.arms * h;
  body.hand = kHand * proportions.arms * h;
  body.torso_radius = kTorsoRadius * h;
  const double trunk = kTrunk + (kThigh + kShank) * (1.0 - proportions.legs);
  const double up = trunk / kSpineSum;

  body.offset.fill(Eigen::Vector3d::Zero());
  for (const SpineBone& bone : kSpine)
    body.offset[bone.joint] = h * Eigen::Vector3d(bone.forward, bone.left, up * bone.up);
  set_pair(body, kLeftHip, h * Eigen::Vector3d(-kHipBack, kHipSide * proportions.hips, -kHipDrop));
  set_pair(body, kLeftKnee, {0.0, 0.0, -body.thigh});
  set_pair(body, kLeftAnkle, {0.0, 0.0, -body.shank});
  set_pair(body, kLeftToe, h * Eigen::Vector3d(kToeForward, 0.0, kToeHeight - kAnkle));
  set_pair(body, kLeftCollar, h * Eigen::Vector3d(-0.008, 0.042 * proportions.shoulders, up * 0.062));
  set_pair(body, kLeftShoulder, h * Eigen::Vector3d(-0.004, 0.068 * proportions.shoulders, up * 0.018));
  set_pair(body, kLeftElbow, {0.0, body.upper_arm, 0.0});
  set_pair(body, kLeftWrist, {0.0, body.forearm, 0.0});
  set_pair(body, kLeftHand, {0.0, body.hand, 0.0});
  body.stand_height = kAnkle * h + kStandExtension * body.leg() + kHipDrop * h;
  return body;
}

}  // namespace duet::synthesis
