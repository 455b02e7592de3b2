#include "duet/tasks/synthesis/performer.h"

#include <cmath>
#include <utility>

#include "duet/core/require.h"
#include "duet/tasks/synthesis/curves.h"

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
  PosedBody figure;
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

namespace {

using Eigen::Vector3d;

constexpr double kHandSway = 0.007;  // [m]

Vector3d shoulder(const Moment& moment) { return moment.own.p.col(sided(kLeftShoulder, moment.side)); }

Vector3d mirrored_for(int side, const Vector3d& v) { return {v.x(), side_sign(side) * v.y(), v.z()}; }

}  // namespace

Vector3d chest_vector(const Moment& moment, const Vector3d& left_arm_vector) {
  return moment.own.R[kSpine3] * mirrored_for(moment.side, left_arm_vector);
}

Hold hanging(double outward, double upright) {
  return [=](const Moment& m) {
    const double out = outward + 0.012 * m.sway.y();
    const double swing = m.swing + 0.05 + 0.02 * m.sway.x();
    const Vector3d along =
        mirrored_for(m.side, {std::sin(swing) * std::cos(out), std::sin(out), -std::cos(swing) * std::cos(out)});
    const Vector3d direction =
        (upright * (rot_z(m.own.yaw) * along) + (1.0 - upright) * (m.own.R[kSpine3] * along)).normalized();
    ArmPose arm;
    // A forward swing goes with a little more bend of the elbow.
    arm.hand = shoulder(m) + (0.965 - 0.02 * std::tanh(2.0 * m.swing)) * m.body.arm() * direction;
    arm.pole = chest_vector(m, {-1.0, 0.35, 0.0});
    return arm;
  };
}

Hold from_shoulder(const Vector3d& offset, const Vector3d& pole, double wrist) {
  return [=](const Moment& m) {
    ArmPose arm;
    arm.hand = shoulder(m) + m.body.arm() * chest_vector(m, offset) + kHandSway * m.sway;
    arm.pole = chest_vector(m, pole);
    arm.wrist = wrist;
    return arm;
  };
}

Hold at_point(std::function<Vector3d(double t)> point, const Vector3d& pole, double wrist) {
  return [point = std::move(point), pole, wrist](const Moment& m) {
    ArmPose arm;
    arm.hand = point(m.t);
    arm.pole = chest_vector(m, pole);
    arm.wrist = wrist;
    return arm;
  };
}

void ArmTrack::to(double begin, double end, Hold hold, const Vector3d& arc) {
  require(end > begin && begin >= free_at() - 1e-9, "synthesis arm: a move overlaps the one before it");
  moves_.push_back({begin, end, std::move(hold), arc});
}

ArmPose ArmTrack::at(const Moment& moment) const {
  size_t current = moves_.size();
  for (size_t k = 0; k < moves_.size() && moment.t > moves_[k].begin; ++k) current = k;
  if (current == moves_.size()) return rest_(moment);
  const Move& move = moves_[current];
  const double u = (moment.t - move.begin) / (move.end - move.begin);
  ArmPose next = move.hold(moment);
  if (u >= 1.0) return next;
  const ArmPose last = current == 0 ? rest_(moment) : moves_[current - 1].hold(moment);
  const double s = ramp(u);
  ArmPose arm;
  arm.hand = last.hand + s * (next.hand - last.hand) + pulse(u) * chest_vector(moment, move.arc);
  arm.pole = last.pole + s * (next.pole - last.pole);
  arm.wrist = last.wrist + s * (next.wrist - last.wrist);
  return arm;
}

}  // namespace duet::synthesis
