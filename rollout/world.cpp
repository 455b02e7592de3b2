#include "duet/rollout/world.h"

#include <Eigen/Geometry>

#include "duet/core/require.h"

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

Recording play_back(const RobotMotion& motion, const PointTracks& partner, std::optional<Task> task,
                    const Phases& phases, const std::shared_ptr<const RobotModel>& robot) {
  require(motion.frames() >= 2, "playback needs 2 frames or more, found {}", motion.frames());
  require(partner.empty() || partner.frames() == motion.frames(),
          "playback: {} frames of the robot but {} of the partner", motion.frames(), partner.frames());
  Recording recording;
  recording.task = task;
  recording.phases = phases;
  recording.rate_hz = motion.rate_hz;
  recording.partner = partner;
  RobotState start = robot->standing_state(motion.root[0]);
  start.X_WB = motion.root[0];
  start.q = motion.q.col(0);
  KinematicFollower follower(start);
  for (int t = 0; t < motion.frames(); ++t) {
    const Reference reference = motion.reference(t);
    if (t > 0) follower.go_to(reference, 1.0 / motion.rate_hz);
    recording.robot.push_back(follower.state());
    recording.reference.push_back(reference);
    recording.q_target.push_back(reference.q);
  }
  return recording;
}

}  // namespace duet
