#include "duet/robots/roles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "duet/core/skeleton.h"
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

}  // namespace duet
