#include "duet/tasks/synthesis/figure.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace duet::synthesis {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kArmSaturation =
    0.995;                          // extension that no target exceeds: 11 degrees from shoulder-elbow to elbow-hand
constexpr double kTightest = 0.36;  // least distance of the ends, in shares of the limb: 138 degrees of flexion

void place(const Body& body, int joint, Figure& figure) {
  const int parent = kSmplParents[joint];
  figure.p.col(joint) = figure.p.col(parent) + figure.R[parent] * body.offset[joint];
}

// Identity up to `soft`, then bends over to approach `hard`; slope and curvature stay continuous at `soft`.
double saturate(double x, double soft, double hard) {
  if (x <= soft) return x;
  const double room = hard - soft;
  return soft + room * std::tanh((x - soft) / room);
}

double reach_between(double distance, double length) {
  const double far = saturate(distance, kArmReach * length, kArmSaturation * length);
  return -saturate(-far, -1.15 * kTightest * length, -kTightest * length);
}

// The plane of a two-bone limb: `first` and `second` are the directions of the bones, `hinge` the axis about which
// bending turns the first into the second.
struct Limb {
  Vector3d first, second, hinge;
};

Limb bend_limb(const Vector3d& from, const Vector3d& to, const Vector3d& pole, double a, double b, double distance) {
  const Vector3d n = (to - from).normalized();
  const Vector3d p = (pole - pole.dot(n) * n).normalized();
  const double along = std::clamp((a * a + distance * distance - b * b) / (2.0 * a * distance), -1.0, 1.0);
  const double across = std::sqrt(1.0 - along * along);
  Limb limb;
  limb.first = along * n + across * p;
  limb.second = (distance * n - a * limb.first) / b;
  limb.hinge = p.cross(n);
  return limb;
}

Matrix3d columns(const Vector3d& x, const Vector3d& y, const Vector3d& z) {
  Matrix3d m;
  m << x, y, z;
  return m;
}

// Legs rest along -z and bend about +y.
Matrix3d leg_frame(const Vector3d& bone, const Vector3d& hinge) { return columns(bone.cross(hinge), hinge, -bone); }

// Arms rest along +y (left) or -y (right) and bend about -z or +z.
Matrix3d arm_frame(const Vector3d& bone, const Vector3d& hinge, double sign) {
  return columns(hinge.cross(bone), sign * bone, -sign * hinge);
}

Vector3d turned(const Vector3d& bone, const Vector3d& hinge, double angle) {
  return std::cos(angle) * bone + std::sin(angle) * hinge.cross(bone);
}

}  // namespace

Matrix3d rot_x(double angle) { return Eigen::AngleAxisd(angle, Vector3d::UnitX()).toRotationMatrix(); }
Matrix3d rot_y(double angle) { return Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix(); }
Matrix3d rot_z(double angle) { return Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix(); }

void pose_torso(const Body& body, const TorsoPose& torso, Figure& figure) {
  figure.yaw = torso.yaw;
  figure.p.col(kPelvis) = torso.pelvis;
  figure.R[kPelvis] = rot_z(torso.yaw + torso.pelvis_yaw) * rot_y(torso.pelvis_pitch) * rot_x(torso.pelvis_roll);
  for (const int hip : {kLeftHip, kRightHip}) place(body, hip, figure);

  const Matrix3d bend = rot_z(torso.twist / 3.0) * rot_y(torso.spine_bend / 3.0) * rot_x(torso.spine_side / 3.0);
  for (const int joint : {kSpine1, kSpine2, kSpine3}) {
    place(body, joint, figure);
    figure.R[joint] = figure.R[kSmplParents[joint]] * bend;
  }
  const Matrix3d look = rot_z(0.5 * torso.look_yaw) * rot_y(0.5 * torso.look_pitch);
  for (const int joint : {kNeck, kHead}) {
    place(body, joint, figure);
    figure.R[joint] = figure.R[kSmplParents[joint]] * look;
  }
  for (const int side : {0, 1}) {
    const int collar = sided(kLeftCollar, side);
    place(body, collar, figure);
    figure.R[collar] = figure.R[kSpine3] * rot_x(side_sign(side) * torso.shrug[side]);
    place(body, sided(kLeftShoulder, side), figure);
  }
}

Vector3d ankle_of(const Body& body, const FootPose& foot, int side) {
  return foot.toe - rot_z(foot.yaw) * rot_y(foot.pitch) * body.offset[sided(kLeftToe, side)];
}

void pose_leg(const Body& body, const FootPose& foot, int side, Figure& figure) {
  const int hip = sided(kLeftHip, side), knee = sided(kLeftKnee, side), ankle = sided(kLeftAnkle, side),
            toe = sided(kLeftToe, side);
  const Vector3d from = figure.p.col(hip);
  const Vector3d to = ankle_of(body, foot, side);
  const double distance = std::min((to - from).norm(), 0.9995 * body.leg());
  // Knees point where hips and feet point on average.
  const Vector3d pole = figure.R[kPelvis].col(0) + rot_z(foot.yaw).col(0);
  const Limb limb = bend_limb(from, to, pole, body.thigh, body.shank, distance);
  figure.R[hip] = leg_frame(limb.first, limb.hinge);
  figure.R[knee] = leg_frame(limb.second, limb.hinge);
  figure.R[ankle] = rot_z(foot.yaw) * rot_y(foot.pitch);
  figure.R[toe] = figure.R[ankle];
  for (const int joint : {knee, ankle, toe}) place(body, joint, figure);
}

void pose_arm(const Body& body, const ArmPose& arm, int side, Figure& figure) {
  const int shoulder = sided(kLeftShoulder, side), elbow = sided(kLeftElbow, side), wrist = sided(kLeftWrist, side),
            hand = sided(kLeftHand, side);
  // Forearm and bent hand act as one rigid link from elbow to hand joint.
  const double lower = std::hypot(body.forearm + body.hand * std::cos(arm.wrist), body.hand * std::sin(arm.wrist));
  const double inner = std::atan2(body.hand * std::sin(arm.wrist), body.forearm + body.hand * std::cos(arm.wrist));
  const Vector3d from = figure.p.col(shoulder);
  const double distance = reach_between((arm.hand - from).norm(), body.upper_arm + lower);
  const Limb limb = bend_limb(from, arm.hand, arm.pole, body.upper_arm, lower, distance);
  const double sign = side_sign(side);
  figure.R[shoulder] = arm_frame(limb.first, limb.hinge, sign);
  figure.R[elbow] = arm_frame(turned(limb.second, limb.hinge, -inner), limb.hinge, sign);
  figure.R[wrist] = arm_frame(turned(limb.second, limb.hinge, arm.wrist - inner), limb.hinge, sign);
  figure.R[hand] = figure.R[wrist];
  for (const int joint : {elbow, wrist, hand}) place(body, joint, figure);
}

}  // namespace duet::synthesis
