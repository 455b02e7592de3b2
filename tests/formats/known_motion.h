// A motion whose every number is known, and files of it in the layouts that duet only reads: what the tests of the
// formats and the fuzzer start from.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npz.h"
#include "duet/formats/motion_source.h"
#include "duet/formats/robot_motion_format.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

// Walks and turns: every joint moves within its limits (legs by .05 rad), the lower sole is on the floor.
inline RobotMotion known_motion(const RobotModel& robot, int frames = 12, double rate_hz = 50.0) {
  RobotMotion motion;
  motion.rate_hz = rate_hz;
  motion.joint_names = robot.joint_names();
  motion.q.resize(robot.dof(), frames);
  Kinematics kinematics(robot);
  std::vector<bool> leg(static_cast<std::size_t>(robot.dof()), false);
  for (const std::vector<int>& side : robot.roles.legs)
    for (const int j : side) leg[static_cast<std::size_t>(j)] = true;
  for (int t = 0; t < frames; ++t) {
    for (int j = 0; j < robot.dof(); ++j) {
      const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      const double swing = leg[static_cast<std::size_t>(j)] ? 0.05 : 0.3;
      motion.q(j, t) = std::clamp(robot.neutral[j] + swing * std::sin(0.4 * t + 0.7 * j), joint.lower, joint.upper);
    }
    Pose X_WB{.R = yaw_rotation(0.4 + 0.03 * t) * Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY())),
              .p = {0.02 * t, 0.1 + 0.01 * t, 0.0}};
    kinematics.update(X_WB, motion.q.col(t));
    double lowest = 1e9;
    for (const int shape : robot.feet)
      lowest =
          std::min(lowest, kinematics.shape_position(shape).z() - robot.shapes[static_cast<std::size_t>(shape)].radius);
    X_WB.p.z() = -lowest;
    motion.root.push_back(X_WB);
  }
  return motion;
}

// [p, quaternion wxyz, q] of each frame. (7 + n, T)
inline Eigen::MatrixXd known_qpos(const RobotMotion& motion, const std::vector<int>& joints) {
  return stacked(stacked(root_positions(motion), root_quaternions(motion, QuaternionOrder::kWxyz)),
                 rows_of(motion.q, joints));
}

inline std::string phuma_stand_in(const RobotMotion& motion, const RobotModel& robot) {
  const std::vector<int> joints = without_wrists(robot, joints_in_order(robot, TreeOrder::kDepthFirst));
  const Eigen::MatrixXd rows = stacked(stacked(rows_of(motion.q, joints), root_positions(motion)),
                                       root_quaternions(motion, QuaternionOrder::kXyzw));
  return npy_bytes({{static_cast<std::size_t>(rows.cols()), static_cast<std::size_t>(rows.rows())},
                    std::vector<double>(rows.data(), rows.data() + rows.size())});
}

// With the pose of one object behind the joints.
inline std::string omniretarget_stand_in(const RobotMotion& motion, const RobotModel& robot) {
  Npz npz;
  const Eigen::MatrixXd object = Eigen::MatrixXd::Constant(7, motion.frames(), 0.5);
  put_rows(npz, "qpos", stacked(known_qpos(motion, joints_in_order(robot, TreeOrder::kDepthFirst)), object));
  npz.set("human_joints", PointTracks(motion.frames(), 22));
  npz.set_number("fps", motion.rate_hz);
  npz.set_number("cost", 1.5);
  return npz.bytes();
}

// Two trajectories: the motion, then the motion again from its second frame on.
inline std::string locomujoco_stand_in(const RobotMotion& motion, const RobotModel& robot) {
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kBreadthFirst);
  const Eigen::MatrixXd qpos = known_qpos(motion, joints);
  const Eigen::Index frames = qpos.cols();
  Eigen::MatrixXd both(qpos.rows(), 2 * frames - 1);
  both << qpos, qpos.rightCols(frames - 1);
  std::vector<std::string> names = joint_names(robot, joints);
  names.insert(names.begin(), "root");
  std::vector<std::int64_t> types(names.size(), 3);
  types.front() = 0;
  Npz npz;
  put_rows(npz, "qpos", both);
  put_rows(npz, "qvel", both.topRows(qpos.rows() - 1));
  npz.set("joint_names", names);
  npz.set("jnt_type", types, {types.size()});
  npz.set_number("frequency", motion.rate_hz);
  npz.set("split_points", std::vector<std::int64_t>{0, frames, 2 * frames - 1}, {3});
  return npz.bytes();
}

// In steps of two substeps; the motion has an even number of frames.
inline std::string spider_stand_in(const RobotMotion& motion, const RobotModel& robot) {
  const Eigen::MatrixXd qpos = known_qpos(motion, joints_in_order(robot, TreeOrder::kDepthFirst));
  const auto steps = static_cast<std::size_t>(motion.frames()) / 2, width = static_cast<std::size_t>(qpos.rows());
  Npz npz;
  npz.set("qpos", std::vector<double>(qpos.data(), qpos.data() + qpos.size()), {steps, 2, width});
  npz.set("qvel", std::vector<double>(steps * 2 * (width - 1)), {steps, 2, width - 1});
  npz.set("ctrl", std::vector<double>(steps * 2 * (width - 7)), {steps, 2, width - 7});
  return npz.bytes();
}

// The content of a file as it would be opened: `files` as a writer gives them.
inline MotionSource source_of(const MotionFiles& files, const std::string& name) {
  if (files.size() == 1 && files.begin()->first.empty()) return motion_source(files.begin()->second, name);
  MotionSource source;
  source.path = name;
  source.container = MotionContainer::kFolder;
  source.files = files;
  return source;
}

// Largest difference of two motions of as many frames: angles [rad], positions [m], turns [rad].
inline double distance(const RobotMotion& a, const RobotMotion& b) {
  if (a.frames() != b.frames() || a.q.rows() != b.q.rows()) return 1e9;
  double worst = (a.q - b.q).cwiseAbs().maxCoeff();
  for (int t = 0; t < a.frames(); ++t) {
    const Pose &x = a.root[static_cast<std::size_t>(t)], &y = b.root[static_cast<std::size_t>(t)];
    worst = std::max({worst, (x.p - y.p).cwiseAbs().maxCoeff(), x.R.angularDistance(y.R)});
  }
  return worst;
}

}  // namespace duet::test
