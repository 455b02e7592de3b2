#include "duet/retarget/partner_arms.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "duet/core/skeleton.h"

namespace duet {
namespace {

struct Arm {
  int collar, shoulder, elbow, wrist, hand;
};
constexpr Arm kArms[] = {{kLeftCollar, kLeftShoulder, kLeftElbow, kLeftWrist, kLeftHand},
                         {kRightCollar, kRightShoulder, kRightElbow, kRightWrist, kRightHand}};

// `p` at `length` from `center`; where the two coincide, towards `fallback`.
Eigen::Vector3d at_distance(const Eigen::Vector3d& center, const Eigen::Vector3d& p, double length,
                            const Eigen::Vector3d& fallback) {
  Eigen::Vector3d d = p - center;
  if (d.norm() < 1e-9) d = fallback;
  return center + length * d.normalized();
}

// The elbow nearest to `elbow` with both bones at their lengths.
Eigen::Vector3d elbow_between(const Eigen::Vector3d& shoulder, const Eigen::Vector3d& wrist,
                              const Eigen::Vector3d& elbow, double upper, double lower) {
  const Eigen::Vector3d span = wrist - shoulder;
  const double distance = span.norm();
  const Eigen::Vector3d along = span / distance;
  const double foot = (distance * distance + upper * upper - lower * lower) / (2.0 * distance);
  const double radius = std::sqrt(std::max(upper * upper - foot * foot, 0.0));
  Eigen::Vector3d side = elbow - shoulder;
  side -= along.dot(side) * along;
  if (side.norm() < 1e-9) side = along.unitOrthogonal();
  return shoulder + foot * along + radius * side.normalized();
}

void keep_lengths(const Arm& arm, const HumanMotion& source, HumanMotion& adapted, int t) {
  const auto was = [&](int joint) { return Eigen::Vector3d(source.joints.at(t, joint)); };
  const auto is = [&](int joint) { return adapted.joints.at(t, joint); };
  const Eigen::Vector3d collar_bone = was(arm.shoulder) - was(arm.collar);
  const double upper = (was(arm.elbow) - was(arm.shoulder)).norm();
  const double lower = (was(arm.wrist) - was(arm.elbow)).norm();
  const Eigen::Vector3d shoulder = at_distance(is(arm.collar), is(arm.shoulder), collar_bone.norm(), collar_bone);
  Eigen::Vector3d wrist = is(arm.wrist);
  const double distance = std::clamp((wrist - shoulder).norm(), std::abs(upper - lower), upper + lower);
  wrist = at_distance(shoulder, wrist, std::max(distance, 1e-6), was(arm.wrist) - was(arm.shoulder));
  const Eigen::Vector3d elbow = elbow_between(shoulder, wrist, is(arm.elbow), upper, lower);
  is(arm.hand) = wrist + was(arm.hand) - was(arm.wrist);
  is(arm.shoulder) = shoulder;
  is(arm.elbow) = elbow;
  is(arm.wrist) = wrist;
}

}  // namespace

int human_offset_of(int smpl) {
  if (smpl >= kLeftShoulder && smpl <= kRightWrist) return smpl - kLeftShoulder;
  if (smpl == kLeftHand || smpl == kRightHand) return smpl - kLeftHand + 4;
  return -1;
}

Eigen::MatrixXd arm_bones(const HumanMotion& person) {
  Eigen::MatrixXd bones(3 * kArmBones, person.frames());
  for (int t = 0; t < person.frames(); ++t) {
    for (int k = 0; k < kArmBones; ++k)
      bones.block<3, 1>(3 * k, t) =
          person.joints.at(t, kLeftShoulder + k) - person.joints.at(t, kSmplParents[kLeftShoulder + k]);
  }
  return bones;
}

void keep_arm_lengths(const HumanMotion& source, HumanMotion& adapted) {
  for (int t = 0; t < source.frames(); ++t) {
    for (const Arm& arm : kArms) keep_lengths(arm, source, adapted, t);
  }
}

}  // namespace duet
