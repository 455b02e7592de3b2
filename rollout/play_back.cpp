#include "duet/rollout/play_back.h"

#include "duet/core/require.h"
#include "duet/rollout/kinematic_follower.h"

namespace duet {

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
