#include "duet/rollout/kinematic_follower.h"

#include <Eigen/Geometry>

namespace duet {
namespace {

// Angular velocity, in the first frame, of the shorter turn from one orientation to another in `seconds`.
Eigen::Vector3d turning_rate(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to, double seconds) {
  Eigen::Quaterniond turn = from.conjugate() * to;
  if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
  const Eigen::AngleAxisd angle_axis(turn);
  return angle_axis.angle() / seconds * angle_axis.axis();
}

}  // namespace

void KinematicFollower::go_to(const Reference& reference, double seconds) {
  if (moved_) {
    state_.v_WB = (reference.X_WB.p - state_.X_WB.p) / seconds;
    state_.w_WB_B = turning_rate(state_.X_WB.R, reference.X_WB.R, seconds);
    state_.v = (reference.q - state_.q) / seconds;
  } else {
    state_.v_WB.setZero();
    state_.w_WB_B.setZero();
    state_.v.setZero();
  }
  state_.X_WB = reference.X_WB;
  state_.q = reference.q;
  moved_ = true;
}

}  // namespace duet
