#include "duet/retarget/leg_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "duet/robots/roles.h"

namespace duet {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 12>;

constexpr int kSteps = 20;
constexpr double kTurnWeight = 0.1;   // [m/rad]: where both cannot be had, the place of the sole comes before its turn
constexpr double kDamping = 1e-8;     // of the squared Jacobian
constexpr double kBentReach = 0.985;  // of a straight leg, where the knee still has a slope
constexpr double kDone = 1e-6;        // [m]
constexpr double kLongestStep = 0.3;  // of a joint in one step [rad]

Eigen::Vector3d turn_to(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  const Eigen::AngleAxisd turn(to * from.transpose());
  return turn.angle() * turn.axis();
}

}  // namespace

struct LegPose::Walk {
  Eigen::Matrix3d R_WF;
  Eigen::Vector3d p_WF;
  std::vector<Eigen::Vector3d> axis, at;  // of each link of the path, W
};

LegPose::LegPose(const RobotModel& robot) : robot_(robot) {
  const std::vector<std::vector<int>> soles = soles_of_feet(robot);
  for (int side = 0; side < 2; ++side) {
    Leg& leg = legs_[side];
    leg.joints = robot.roles.legs[side];
    const int foot = robot.shapes[soles[side].front()].link;
    for (int link = foot; link > 0; link = robot.links[link].parent) leg.path.push_back(link);
    std::reverse(leg.path.begin(), leg.path.end());
    Walk walked;
    walk(leg, {}, Eigen::VectorXd::Zero(robot.dof()), walked);
    const Eigen::Matrix3d R_LB = walked.R_WF.transpose();
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const int shape : soles[side]) middle += robot.shapes[shape].X_LS.p / static_cast<double>(soles[side].size());
    leg.sole = {Eigen::Quaterniond(R_LB), middle - R_LB.col(2) * robot.shapes[soles[side].front()].radius};
    const std::size_t first = leg.path.size() - leg.joints.size();
    leg.hip = walked.at[first];
    leg.length = (walked.at.back() - leg.hip).norm();
    leg.ankle_height = -(leg.sole.R.conjugate() * leg.sole.p).z();
  }
}

void LegPose::walk(const Leg& leg, const Pose& X_WB, const Eigen::VectorXd& q, Walk& out) const {
  out.axis.resize(leg.path.size());
  out.at.resize(leg.path.size());
  Eigen::Matrix3d R = X_WB.R.toRotationMatrix();
  Eigen::Vector3d p = X_WB.p;
  for (std::size_t i = 0; i < leg.path.size(); ++i) {
    const RobotLink& link = robot_.links[leg.path[i]];
    p += R * link.X_PL.p;
    R = R * link.X_PL.R.toRotationMatrix() * Eigen::AngleAxisd(q[leg.path[i] - 1], link.axis);
    out.at[i] = p;
    out.axis[i] = R * link.axis;
  }
  out.R_WF = R;
  out.p_WF = p;
}

Pose LegPose::sole_pose(int side, const Pose& X_WB, const Eigen::VectorXd& q) const {
  Walk walked;
  walk(legs_[side], X_WB, q, walked);
  return Pose{Eigen::Quaterniond(walked.R_WF), walked.p_WF} * legs_[side].sole;
}

Pose LegPose::within_reach(int side, const Pose& X_WB, const Pose& X_WS) const {
  const Leg& leg = legs_[side];
  const Eigen::Vector3d hip = X_WB * leg.hip;
  const Eigen::Vector3d span = X_WS * leg.sole.inverse().p - hip;
  const double most = kBentReach * leg.length;
  if (span.norm() <= most) return X_WS;
  return {X_WS.R, X_WS.p + span * (most / span.norm() - 1.0)};
}

double LegPose::solve(int side, const Pose& X_WB, const Pose& X_WS, Eigen::VectorXd& q) const {
  const Leg& leg = legs_[side];
  const Pose X_WF = X_WS * leg.sole.inverse();
  const Eigen::Matrix3d target = X_WF.R.toRotationMatrix();
  const auto joints = static_cast<Eigen::Index>(leg.joints.size());
  const std::size_t first = leg.path.size() - leg.joints.size();
  Walk walked;
  Matrix6X J(6, joints);
  double miss = 0.0;
  for (int step = 0; step <= kSteps; ++step) {
    walk(leg, X_WB, q, walked);
    Vector6 error;
    error << X_WF.p - walked.p_WF, kTurnWeight * turn_to(walked.R_WF, target);
    miss = error.head<3>().norm();
    if (step == kSteps || error.norm() < kDone) break;
    for (Eigen::Index k = 0; k < joints; ++k) {
      const Eigen::Vector3d& axis = walked.axis[first + k];
      J.col(k) << axis.cross(walked.p_WF - walked.at[first + k]), kTurnWeight * axis;
      const RobotJoint& joint = robot_.joints[leg.joints[k]];  // a joint at its limit does not share in the step
      const double angle = q[leg.joints[k]];
      const double wish = J.col(k).dot(error);
      if ((angle <= joint.lower && wish < 0.0) || (angle >= joint.upper && wish > 0.0)) J.col(k).setZero();
    }
    Eigen::Matrix<double, 6, 6> gram = J * J.transpose();
    gram.diagonal().array() += kDamping + 1e-2 * error.squaredNorm();
    const Eigen::VectorXd change = J.transpose() * gram.ldlt().solve(error);
    const double shrink = std::min(1.0, kLongestStep / std::max(change.cwiseAbs().maxCoeff(), 1e-12));
    for (Eigen::Index k = 0; k < joints; ++k) {
      const RobotJoint& joint = robot_.joints[leg.joints[k]];
      q[leg.joints[k]] = std::clamp(q[leg.joints[k]] + shrink * change[k], joint.lower, joint.upper);
    }
  }
  return miss;
}

}  // namespace duet
