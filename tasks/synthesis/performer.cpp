#include "duet/tasks/synthesis/performer.h"

#include <cmath>

namespace duet::synthesis {
namespace {

constexpr double kPelvisShare = 0.62;    // of the trunk's inclination that comes from the hips, the rest from the spine
constexpr double kCounterweight = 0.07;  // backward shift of the pelvis at a right angle, in statures

double missing(const Body& body, int side, const Eigen::Vector3d& target, const Lean& lean, double share) {
  return (target - shoulder_at(body, side, lean)).norm() - share * body.arm();
}

}  // namespace

void Performer::lean_to(double begin, double end, const Lean& lean) {
  forward.to(begin, end, lean.forward);
  side.to(begin, end, lean.side);
  twist.to(begin, end, lean.twist);
  crouch.to(begin, end, lean.crouch);
  shift.to(begin, end, lean.shift);
}

TorsoPose standing_torso(const Body& body, const Placement& root, const Lean& lean, double height) {
  TorsoPose torso;
  torso.yaw = root.yaw;
  const double ahead = lean.shift - kCounterweight * body.height * std::sin(lean.forward);
  torso.pelvis << root.position + ahead * Eigen::Vector2d(std::cos(root.yaw), std::sin(root.yaw)), height - lean.crouch;
  torso.pelvis_yaw = lean.hips;
  torso.pelvis_pitch = kPelvisShare * lean.forward;
  torso.spine_bend = (1.0 - kPelvisShare) * lean.forward;
  torso.spine_side = lean.side;
  torso.twist = lean.twist;
  return torso;
}

Eigen::Vector3d shoulder_at(const Body& body, int side, const Lean& lean) {
  Figure figure;
  pose_torso(body, standing_torso(body, {}, lean, body.stand_height), figure);
  return figure.p.col(sided(kLeftShoulder, side));
}

Lean lean_to_reach(const Body& body, int side, const Eigen::Vector3d& target, const Lean& from, double share) {
  constexpr double kStep = 0.01, kMostLean = 0.5, kMostCrouch = 0.12;
  Lean lean = from;
  while (missing(body, side, target, lean, share) > 0.0) {
    Lean more = lean;
    more.forward += kStep;
    const bool helps = more.forward <= kMostLean &&
                       missing(body, side, target, more, share) < missing(body, side, target, lean, share) - 1e-4;
    if (helps) {
      lean = more;
    } else if (lean.crouch + kStep <= kMostCrouch && target.z() < body.stand_height) {
      lean.crouch += kStep;
    } else {
      break;
    }
  }
  return lean;
}

}  // namespace duet::synthesis
