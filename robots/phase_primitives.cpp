#include "duet/robots/phase_primitives.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

// Joints that are no leg's.
std::vector<int> upper_joints(const RobotModel& robot) {
  const std::vector<int> legs = leg_joints(robot);
  std::vector<int> upper;
  for (int j = 0; j < robot.dof(); ++j)
    if (!std::binary_search(legs.begin(), legs.end(), j)) upper.push_back(j);
  return upper;
}

}  // namespace

void walk_straight(RobotMotion& motion, const Phases& phases, const Pose& start) {
  if (phases.act_begin == 0) return;
  const Pose goal = motion.root[static_cast<std::size_t>(phases.act_begin)];
  for (int t = 0; t < phases.act_begin; ++t)
    motion.root[static_cast<std::size_t>(t)] = interpolate(start, goal, static_cast<double>(t) / phases.act_begin);
}

void raise_upper_body(RobotMotion& motion, const Phases& phases, const RobotModel& robot, int frames) {
  const std::vector<int> upper = upper_joints(robot);
  const Eigen::VectorXd goal = motion.q.col(phases.act_begin);
  const int begin = std::max(0, phases.act_begin - frames);
  for (int t = 0; t < phases.act_begin; ++t) {
    const double s = t < begin ? 0.0 : static_cast<double>(t - begin) / (phases.act_begin - begin);
    for (const int j : upper) motion.q(j, t) = (1.0 - s) * robot.neutral[j] + s * goal[j];
  }
}

void lower_upper_body(RobotMotion& motion, const Phases& phases, const RobotModel& robot, double frames) {
  const std::vector<int> upper = upper_joints(robot);
  const Eigen::VectorXd last = motion.q.col(phases.act_end - 1);
  for (int t = phases.act_end; t < motion.frames(); ++t) {
    const double s = frames > 0.0 ? std::min(1.0, (t - phases.act_end + 1) / frames) : 1.0;
    for (const int j : upper) motion.q(j, t) = (1.0 - s) * last[j] + s * robot.neutral[j];
  }
}

void hold_frame(RobotMotion& motion, const RobotModel& robot, int begin, int end, int source) {
  const std::vector<int> legs = leg_joints(robot);
  for (int t = begin; t < end; ++t) {
    motion.root[static_cast<std::size_t>(t)] = Pose(motion.root[static_cast<std::size_t>(source)]);
    for (const int j : legs) motion.q(j, t) = motion.q(j, source);
  }
}

Pose mildly_turned(const Pose& start, const Pose& goal, double mild_yaw) {
  const double turn = std::remainder(yaw_of(start.R) - yaw_of(goal.R), 2.0 * std::numbers::pi);
  const double back = std::clamp(turn, -mild_yaw, mild_yaw) - turn;
  return {(yaw_rotation(back) * start.R).normalized(), start.p};
}

void sim_to_real(RobotMotion& motion, const Phases& phases, const RobotModel& robot, double mild_yaw) {
  require(motion.joint_names == robot.joint_names() && motion.q.rows() == robot.dof(),
          "sim to real: expected the {} joints of robot '{}' in its order, found {}", robot.dof(), robot.name,
          fmt::join(motion.joint_names, ", "));
  require(0 <= phases.act_begin && phases.act_begin < phases.act_end && phases.act_end <= motion.frames(),
          "sim to real: expected an act inside [0, {}), found [{}, {})", motion.frames(), phases.act_begin,
          phases.act_end);
  require(std::isfinite(mild_yaw) && mild_yaw >= 0.0, "sim to real: expected a turn of 0 or more, found {} rad",
          mild_yaw);
  const Pose goal = motion.root[static_cast<std::size_t>(phases.act_begin)];
  walk_straight(motion, phases, mildly_turned(motion.root.front(), goal, mild_yaw));
  raise_upper_body(motion, phases, robot, kSimToRealRamp);
  lower_upper_body(motion, phases, robot, kSimToRealRamp);
  hold_frame(motion, robot, phases.act_end, motion.frames(), phases.act_end - 1);
}

}  // namespace duet
