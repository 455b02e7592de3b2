// The detectors' tracks of a human and of a robot.
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "duet/core/require.h"
#include "duet/core/skeleton.h"
#include "duet/metrics/detector.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

struct Follower {
  int frame;
  Eigen::Matrix3Xd* track;
};

Agent empty_agent(Eigen::Index frames) {
  Agent agent;
  for (Eigen::Matrix3Xd* track :
       {&agent.lhand, &agent.rhand, &agent.head, &agent.root, &agent.torso, &agent.lshoulder, &agent.rshoulder})
    track->resize(3, frames);
  return agent;
}

// Median over the frames of the mean of both arms. [m]
double arm_of(const PointTracks& smpl24) {
  std::vector<double> arms;
  for (int t = 0; t < smpl24.frames(); ++t) {
    const PointTracks::ConstFrame joints = smpl24.frame(t);
    double both = 0.0;
    for (const auto& [from, to] : {std::pair{kLeftShoulder, kLeftElbow},
                                   {kLeftElbow, kLeftWrist},
                                   {kLeftWrist, kLeftHand},
                                   {kRightShoulder, kRightElbow},
                                   {kRightElbow, kRightWrist},
                                   {kRightWrist, kRightHand}})
      both += (joints.col(to) - joints.col(from)).norm();
    arms.push_back(0.5 * both);
  }
  if (arms.empty()) return kAdultArm;
  const auto middle = arms.begin() + static_cast<std::ptrdiff_t>(arms.size() / 2);
  std::nth_element(arms.begin(), middle, arms.end());
  return *middle > 0.0 ? *middle : kAdultArm;
}

// `pose(t)` and `joints(t)` are the base's pose and the joint angles at frame t.
template <typename PoseAt, typename JointsAt>
Agent follow(const RobotModel& robot, int frames, PoseAt pose, JointsAt joints) {
  Agent agent = empty_agent(frames);
  const Follower followers[] = {
      {robot.track_frame("lhand"), &agent.lhand},         {robot.track_frame("rhand"), &agent.rhand},
      {robot.track_frame("head"), &agent.head},           {robot.track_frame("torso"), &agent.torso},
      {robot.track_frame("lshoulder"), &agent.lshoulder}, {robot.track_frame("rshoulder"), &agent.rshoulder}};
  agent.arm = 0.5 * (arm_length(robot, 0) + arm_length(robot, 1));
  Kinematics kinematics(robot);
  for (int t = 0; t < frames; ++t) {
    if (joints(t).size() != robot.dof())
      throw std::invalid_argument(fmt::format("robot agent: frame {} has {} joint angles, {} has {}", t,
                                              joints(t).size(), robot.name, robot.dof()));
    kinematics.update(pose(t), joints(t));
    agent.root.col(t) = pose(t).p;
    for (const auto& [frame, track] : followers) track->col(t) = kinematics.frame_position(frame);
  }
  return agent;
}

}  // namespace

Agent human_agent(const PointTracks& smpl24) {
  require(smpl24.points() == kSmplJoints, "human agent: expected {} joints, found {}", kSmplJoints, smpl24.points());
  Agent agent = empty_agent(smpl24.frames());
  for (int t = 0; t < smpl24.frames(); ++t) {
    const PointTracks::ConstFrame joints = smpl24.frame(t);
    agent.lhand.col(t) = joints.col(kLeftHand);
    agent.rhand.col(t) = joints.col(kRightHand);
    agent.head.col(t) = joints.col(kHead);
    agent.root.col(t) = joints.col(kPelvis);
    agent.torso.col(t) = joints.col(kSpine3);
    agent.lshoulder.col(t) = joints.col(kLeftShoulder);
    agent.rshoulder.col(t) = joints.col(kRightShoulder);
  }
  agent.arm = arm_of(smpl24);
  return agent;
}

Agent robot_agent(const RobotModel& robot, const std::vector<RobotState>& states) {
  return follow(
      robot, static_cast<int>(states.size()), [&](int t) -> const Pose& { return states[t].X_WB; },
      [&](int t) -> const Eigen::VectorXd& { return states[t].q; });
}

Agent robot_agent(const RobotModel& robot, const RobotMotion& motion) {
  require(motion.joint_names.empty() || motion.joint_names == robot.joint_names(),
          "robot agent: the joints of the motion are not those of {} in its order", robot.name);
  require(motion.q.cols() == motion.frames(), "robot agent: {} root poses, but joint angles of {} frames",
          motion.frames(), motion.q.cols());
  return follow(
      robot, motion.frames(), [&](int t) -> const Pose& { return motion.root[t]; },
      [&](int t) { return motion.q.col(t); });
}

}  // namespace duet
