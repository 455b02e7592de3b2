#include "duet/robots/roles.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

constexpr double kUpright = 0.9;  // least cosine of an axis that counts as the vertical

const RobotFrame* pelvis_frame(const RobotModel& robot) {
  const auto found = std::ranges::find_if(robot.pairs, [](const RetargetPair& pair) { return pair.smpl == kPelvis; });
  return found == robot.pairs.end() ? nullptr : &robot.frames[found->frame];
}

}  // namespace

Eigen::Vector3d hinge_axis(const RobotModel& robot, int joint) {
  Eigen::Vector3d axis = robot.links[joint + 1].axis;
  for (int link = joint + 1; link > 0; link = robot.links[link].parent) axis = robot.links[link].X_PL.R * axis;
  return axis;
}

Eigen::Vector3d mirrored_axis(const Eigen::Vector3d& axis) { return {-axis.x(), axis.y(), -axis.z()}; }

double mirror_sign(const RobotModel& robot, int joint) {
  const Eigen::Vector3d image = mirrored_axis(hinge_axis(robot, joint));
  return image.dot(hinge_axis(robot, robot.roles.counterpart[joint])) > 0.0 ? 1.0 : -1.0;
}

bool is_roll(const RobotModel& robot, int joint) {
  const Eigen::Vector3d axis = hinge_axis(robot, joint);
  return std::abs(axis.x()) > std::abs(axis.y());
}

std::vector<int> tilting_waist(const RobotModel& robot) {
  std::vector<int> tilting;
  for (const int joint : robot.roles.waist)
    if (std::abs(hinge_axis(robot, joint).z()) < kUpright) tilting.push_back(joint);
  return tilting;
}

double arm_length(const RobotModel& robot, int side) {
  const RobotFrame& shoulder = robot.frames[robot.track_frame(side == 0 ? "lshoulder" : "rshoulder")];
  const RobotFrame& hand = robot.frames[robot.track_frame(side == 0 ? "lhand" : "rhand")];
  Eigen::Vector3d end = hand.X_LF.p;  // of the last piece, in the link that it begins in
  double length = 0.0;
  for (int link = hand.link; link > 0 && link != shoulder.link; link = robot.links[link].parent) {
    length += end.norm();
    end = robot.links[link].X_PL.p;
    if (robot.links[link].parent == shoulder.link) return length + (end - shoulder.X_LF.p).norm();
  }
  if (hand.link == shoulder.link) return (end - shoulder.X_LF.p).norm();
  Kinematics kinematics(robot);  // a shoulder's track on the trunk
  kinematics.update({}, robot.neutral);
  return (kinematics.frame_position(robot.track_frame(side == 0 ? "lhand" : "rhand")) -
          kinematics.frame_position(robot.track_frame(side == 0 ? "lshoulder" : "rshoulder")))
      .norm();
}

std::vector<int> leg_joints(const RobotModel& robot) {
  std::vector<int> joints;
  for (const std::vector<int>& leg : robot.roles.legs) joints.insert(joints.end(), leg.begin(), leg.end());
  std::ranges::sort(joints);
  return joints;
}

std::vector<std::vector<int>> soles_of_feet(const RobotModel& robot) {
  std::vector<std::vector<int>> feet;
  for (const int shape : robot.feet) {
    if (feet.empty() || robot.shapes[feet.back().front()].link != robot.shapes[shape].link) feet.emplace_back();
    feet.back().push_back(shape);
  }
  return feet;
}

Pose pelvis_in_base(const RobotModel& robot, const Eigen::VectorXd& q) {
  const RobotFrame* const pelvis = pelvis_frame(robot);
  if (pelvis == nullptr) return {};
  Pose X = pelvis->X_LF;
  for (int link = pelvis->link; link > 0; link = robot.links[link].parent) {
    const RobotLink& moved = robot.links[link];
    X = moved.X_PL * Pose{Eigen::Quaterniond(Eigen::AngleAxisd(q[link - 1], moved.axis)), Eigen::Vector3d::Zero()} * X;
  }
  return X;
}

bool base_is_pelvis(const RobotModel& robot) {
  const RobotFrame* const pelvis = pelvis_frame(robot);
  return pelvis == nullptr || (pelvis->link == 0 && pelvis->X_LF.p.isZero(0.0) && pelvis->X_LF.R.vec().isZero(0.0));
}

std::vector<int> upper_joints(const RobotModel& robot) {
  const std::vector<int> legs = leg_joints(robot);
  std::vector<int> upper;
  for (int j = 0; j < robot.dof(); ++j)
    if (!std::binary_search(legs.begin(), legs.end(), j)) upper.push_back(j);
  return upper;
}

void walk_straight(RobotMotion& motion, const Phases& phases, const Pose& start) {
  if (phases.act_begin == 0) return;
  const Pose goal = motion.root[static_cast<std::size_t>(phases.act_begin)];
  for (int t = 0; t < phases.act_begin; ++t)
    motion.root[static_cast<std::size_t>(t)] = interpolate(start, goal, static_cast<double>(t) / phases.act_begin);
}

void walk_and_wait(RobotMotion& motion, const Phases& phases, const RobotModel& robot, const Pose& start,
                   double speed) {
  constexpr double kQuickest = 1.0, kTurn = 0.8;  // [s], [rad/s]
  constexpr int kIntoAct = 20;                    // frames
  const Pose goal = motion.root[static_cast<std::size_t>(phases.act_begin)];
  const double seconds =
      std::max({kQuickest, (goal.p - start.p).head<2>().norm() / speed, goal.R.angularDistance(start.R) / kTurn});
  const int arrives = static_cast<int>(std::min<double>(phases.act_begin, std::ceil(seconds * motion.rate_hz)));
  hold_frame(motion, robot, arrives, phases.act_begin, phases.act_begin);
  walk_straight(motion, {arrives, phases.act_end}, start);
  const int into = std::min(kIntoAct, phases.act_end - phases.act_begin);
  for (const int j : upper_joints(robot)) {
    motion.q.row(j).head(phases.act_begin).setConstant(robot.neutral[j]);
    for (int t = 0; t < into; ++t) {
      double& angle = motion.q(j, phases.act_begin + t);
      angle = std::lerp(robot.neutral[j], angle, static_cast<double>(t) / kIntoAct);
    }
  }
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

JointMap::JointMap(const std::vector<std::string>& from, const RobotModel& to) : neutral_(to.neutral) {
  for (const std::string& name : to.joint_names()) {
    const auto found = std::find(from.begin(), from.end(), name);
    source_.push_back(found == from.end() ? -1 : static_cast<int>(found - from.begin()));
  }
  const bool common = std::ranges::any_of(source_, [](int joint) { return joint >= 0; });
  require(common || from.empty() || source_.empty(),
          "expected a motion with joints of robot '{}' ('{}', ...), found one of '{}', ...", to.name,
          source_.empty() ? "" : to.joints.front().name, from.empty() ? "" : from.front());
}

Eigen::VectorXd JointMap::fill(const Eigen::VectorXd& values, Eigen::VectorXd filled) const {
  for (std::size_t j = 0; j < source_.size(); ++j)
    if (source_[j] >= 0) filled[static_cast<Eigen::Index>(j)] = values[source_[j]];
  return filled;
}

Eigen::VectorXd JointMap::rates(const Eigen::VectorXd& v) const {
  return fill(v, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(source_.size())));
}

RobotState JointMap::state(const RobotState& state) const {
  RobotState moved = state;
  moved.q = positions(state.q);
  moved.v = rates(state.v);
  return moved;
}

RobotMotion on_body(const RobotMotion& motion, const RobotModel& body) {
  if (motion.joint_names == body.joint_names()) return motion;
  const JointMap map(motion.joint_names, body);
  RobotMotion moved{motion.rate_hz, body.joint_names(), motion.root, Eigen::MatrixXd(body.dof(), motion.frames())};
  for (int t = 0; t < motion.frames(); ++t) moved.q.col(t) = map.positions(motion.q.col(t));
  return moved;
}

}  // namespace duet
