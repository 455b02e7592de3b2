// Laws of mode `best`: a motion that is cropped, shifted, mirrored or moved in the world gives the same robot, cropped,
// shifted, mirrored or moved.
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <utility>

#include "duet/core/recording.h"
#include "duet/motion/interaction_clip.h"
#include "duet/retarget/solver/pair.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/roles.h"

namespace duet::test {

inline constexpr double kSame = 0.1;  // most that a joint may differ by [rad]

inline InteractionClip cropped(InteractionClip clip, int frames) {
  for (HumanMotion* motion : {&clip.a, &clip.b}) *motion = slice(*motion, frames, motion->frames());
  clip.phases = {std::max(clip.phases.act_begin - frames, 0), std::max(clip.phases.act_end - frames, 0)};
  clip.contacts.clear();
  return clip;
}

inline InteractionClip moved(InteractionClip clip, double yaw, const Eigen::Vector3d& p) {
  const Eigen::Quaterniond R(yaw_rotation(yaw));
  for (HumanMotion* motion : {&clip.a, &clip.b}) {
    for (int t = 0; t < motion->frames(); ++t) {
      for (int joint = 0; joint < kSmplJoints; ++joint)
        motion->joints.at(t, joint) = (R * Eigen::Vector3d(motion->joints.at(t, joint)) + p).eval();
    }
    for (Eigen::Quaterniond& rotation : motion->rotations) rotation = (R * rotation).normalized();
  }
  return clip;
}

inline Eigen::MatrixXd joints_of(const InteractionClip& clip, const RobotModel& robot) {
  return retarget(clip, robot, pair_options_of(PairMode::kBest)).robot.q;
}

// The mirror image of a motion's joints, by the names of left and right.
inline Eigen::MatrixXd mirrored_joints(const RobotModel& robot, const Eigen::MatrixXd& q) {
  const auto counterpart = [](std::string name) {
    for (const auto& [from, to] :
         {std::pair{"left", "right"}, {"right", "left"}, {"Left", "Right"}, {"Right", "Left"}}) {
      const std::size_t at = name.find(from);
      if (at != std::string::npos) return name.replace(at, std::string(from).size(), to);
    }
    return name;
  };
  Eigen::MatrixXd out(q.rows(), q.cols());
  for (int j = 0; j < robot.dof(); ++j) {
    const int other = robot.joint_index(counterpart(robot.joints[static_cast<std::size_t>(j)].name));
    out.row(j) = mirror_sign(robot, other) * q.row(other);
  }
  return out;
}

inline double farthest(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return (a - b).cwiseAbs().maxCoeff(); }

inline void expect_laws(const InteractionClip& clip, const RobotModel& robot) {
  SCOPED_TRACE(clip.id + " on " + robot.name);
  const Eigen::MatrixXd q = joints_of(clip, robot);
  for (const int frames : {1, 5})
    EXPECT_LT(farthest(q.rightCols(q.cols() - frames), joints_of(cropped(clip, frames), robot)), kSame) << frames;
  const Eigen::MatrixXd later = joints_of(padded(clip, 0.3, 0.0), robot);
  EXPECT_LT(farthest(q, later.rightCols(q.cols())), kSame);
  EXPECT_LT(farthest(q, mirrored_joints(robot, joints_of(mirrored(clip), robot))), kSame);
  EXPECT_LT(farthest(q, joints_of(moved(clip, 2.1, {3.0, -1.5, 0.0}), robot)), kSame);
}

}  // namespace duet::test
