#include "duet/tasks/synthesis/posed_body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace duet::synthesis {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kArmSaturation =
    0.995;                          // extension that no target exceeds: 11 degrees from shoulder-elbow to elbow-hand
constexpr double kTightest = 0.36;  // least distance of the ends, in shares of the limb: 138 degrees of flexion

void place(const Body& body, int joint, PosedBody& figure) {
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

void pose_torso(const Body& body, const TorsoPose& torso, PosedBody& figure) {
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

void pose_leg(const Body& body, const FootPose& foot, int side, PosedBody& figure) {
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

void pose_arm(const Body& body, const ArmPose& arm, int side, PosedBody& figure) {
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

namespace {

struct Column {
  int from, to;
  double begin, end;  // of the axis, in shares of the way from joint to joint
  double radius;      // at the reference spine [m]
};

constexpr double kReferenceSpine = 0.51, kReferenceHand = 0.085;  // [m]
constexpr double kHandRadius = 0.030, kHandBegin = 0.3, kHandEnd = 1.6;
constexpr std::array<Column, 12> kColumns = {{{kNeck, kHead, 0.9, 1.7, 0.095},
                                              {kNeck, kHead, 0.0, 0.8, 0.060},
                                              {kSpine3, kNeck, 0.0, 0.5, 0.115},
                                              {kSpine2, kSpine3, 0.0, 1.0, 0.120},
                                              {kSpine1, kSpine2, 0.0, 1.0, 0.120},
                                              {kPelvis, kSpine1, 0.0, 1.0, 0.120},
                                              {kPelvis, kLeftHip, 0.0, 1.0, 0.100},
                                              {kPelvis, kRightHip, 0.0, 1.0, 0.100},
                                              {kSpine3, kLeftCollar, 0.0, 1.0, 0.090},
                                              {kSpine3, kRightCollar, 0.0, 1.0, 0.090},
                                              {kLeftCollar, kLeftShoulder, 0.0, 1.0, 0.065},
                                              {kRightCollar, kRightShoulder, 0.0, 1.0, 0.065}}};

double spine_of(const Body& body) {
  double length = 0.0;
  for (const int joint : {kSpine1, kSpine2, kSpine3, kNeck}) length += body.offset[joint].norm();
  return length;
}

// The nearest points of two segments, by alternating projection: both are short and few steps are enough for contact.
std::array<Eigen::Vector3d, 2> nearest_points(const SolidPart& one, const SolidPart& other) {
  const auto project = [](const Eigen::Vector3d& point, const SolidPart& part) {
    const Eigen::Vector3d way = part.to - part.from;
    const double share = std::clamp((point - part.from).dot(way) / std::max(way.squaredNorm(), 1e-12), 0.0, 1.0);
    return Eigen::Vector3d(part.from + share * way);
  };
  Eigen::Vector3d p = 0.5 * (one.from + one.to), q = project(p, other);
  for (int i = 0; i < 12; ++i) {
    p = project(q, one);
    q = project(p, other);
  }
  return {p, q};
}

}  // namespace

std::vector<SolidPart> solid_parts(const Body& body, const PosedBody& figure) {
  const double size = spine_of(body) / kReferenceSpine;
  std::vector<SolidPart> parts;
  parts.reserve(kColumns.size());
  for (const Column& column : kColumns) {
    const Eigen::Vector3d from = figure.p.col(column.from), bone = figure.p.col(column.to) - from;
    parts.push_back({from + column.begin * bone, from + column.end * bone, size * column.radius});
  }
  return parts;
}

SolidPart solid_hand(const Body& body, const PosedBody& figure, int side) {
  const Eigen::Vector3d wrist = figure.p.col(sided(kLeftWrist, side));
  const Eigen::Vector3d bone = figure.p.col(sided(kLeftHand, side)) - wrist;
  return {wrist + kHandBegin * bone, wrist + kHandEnd * bone, kHandRadius * body.hand / kReferenceHand};
}

Overlap overlap_of(const SolidPart& part, const SolidPart& other) {
  const auto [p, q] = nearest_points(part, other);
  const double distance = (p - q).norm();
  Overlap overlap{.depth = part.radius + other.radius - distance};
  if (distance > 1e-9) overlap.out = (p - q) / distance;
  return overlap;
}

void pose_arm_outside(const Body& body, const ArmPose& arm, int side, const std::vector<SolidPart>& partner,
                      PosedBody& figure) {
  constexpr int kMost = 24;
  ArmPose pose = arm;
  pose_arm(body, pose, side, figure);
  for (int i = 0; i < kMost; ++i) {
    const SolidPart hand = solid_hand(body, figure, side);
    Overlap worst;
    for (const SolidPart& part : partner) {
      const Overlap overlap = overlap_of(hand, part);
      if (overlap.depth > worst.depth) worst = overlap;
    }
    if (worst.depth < 1e-4) return;
    // From where the hand is, not from a target that it cannot reach.
    pose.hand = figure.p.col(sided(kLeftHand, side)) + 1.05 * worst.depth * worst.out;
    pose_arm(body, pose, side, figure);
  }
}

}  // namespace duet::synthesis
