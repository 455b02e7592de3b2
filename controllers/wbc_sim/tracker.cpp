#include "duet/controllers/wbc_sim/tracker.h"

#include <algorithm>
#include <cmath>

#include "duet/controllers/stance.h"
#include "duet/core/clock.h"
#include "duet/core/require.h"

namespace duet {
namespace {

std::array<LegChain, 2> two_legs(const RobotModel& robot, const Stance& stance) {
  require(stance.legs().size() == 2, "robot '{}' has {} legs, expected 2", robot.name, stance.legs().size());
  return {LegChain(robot, stance.legs()[0]), LegChain(robot, stance.legs()[1])};
}

double wrapped_yaw(double angle) { return std::remainder(angle, 2.0 * M_PI); }

struct Attitude {
  double roll, pitch, yaw;  // R = Rz(yaw) Ry(pitch) Rx(roll)
};

Attitude attitude_of(const Eigen::Quaterniond& R) {
  const Eigen::Matrix3d m = R.toRotationMatrix();
  return {std::atan2(m(2, 1), m(2, 2)), std::asin(std::clamp(-m(2, 0), -1.0, 1.0)), std::atan2(m(1, 0), m(0, 0))};
}

Eigen::Quaterniond rotation(const Attitude& a) {
  return yaw_rotation(a.yaw) * Eigen::AngleAxisd(a.pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(a.roll, Eigen::Vector3d::UnitX());
}

Pose within(const Pose& X_WB, const RootBounds& bounds) {
  Attitude attitude = attitude_of(X_WB.R);
  attitude.roll = std::clamp(attitude.roll, -bounds.max_roll, bounds.max_roll);
  attitude.pitch = std::clamp(attitude.pitch, bounds.min_pitch, bounds.max_pitch);
  return {rotation(attitude), {X_WB.p.x(), X_WB.p.y(), std::clamp(X_WB.p.z(), bounds.lowest, bounds.highest)}};
}

// A displacement in W seen from a heading.
Eigen::Vector2d in_heading(double yaw, const Eigen::Vector3d& d_W) {
  return {std::cos(yaw) * d_W.x() + std::sin(yaw) * d_W.y(), -std::sin(yaw) * d_W.x() + std::cos(yaw) * d_W.y()};
}

GaitOptions on_card(GaitOptions gait, const RobotModel& robot) {
  gait.half_width = robot.stance_size().half_width;
  return gait;
}

}  // namespace

WbcTracker::WbcTracker(std::shared_ptr<const RobotModel> robot, const GaitOptions& gait)
    : robot_(std::move(robot)),
      bounds_(robot_->bounds_of_root()),
      gait_(on_card(gait, *robot_)),
      legs_(two_legs(*robot_, Stance(*robot_))) {
  upper_ = Stance(*robot_).upper();
  Eigen::Matrix<double, 6, 1> q;
  for (int i = 0; i < 6; ++i) q[i] = robot_->neutral[legs_[0].joints()[i]];
  const Pose X_BF = legs_[0].foot_pose(q);
  ankle_height_ = robot_->standing_height + X_BF.p.z();
  foot_x_ = X_BF.p.x();
  q_ = robot_->neutral;
  v_ = last_q_ = Eigen::VectorXd::Zero(robot_->dof());
}

void WbcTracker::reset(const Reference& reference) {
  gait_.reset();
  q_ = robot_->neutral;
  last_root_ = within(reference.X_WB, bounds_);
  track(reference);
  track(reference);  // from the neutral legs the first solution is not yet exact
  last_q_ = q_;
  v_.setZero();
  root_velocity_.setZero();
}

void WbcTracker::update(const RobotState& state, const Reference& reference) {
  const Pose target = within(reference.X_WB, bounds_);
  const double yaw = yaw_of(target.R);
  root_velocity_.head<2>() = kTickRate * in_heading(yaw, target.p - last_root_.p);
  root_velocity_.z() = kTickRate * wrapped_yaw(yaw - yaw_of(last_root_.R));
  Eigen::Vector3d deviation;
  deviation.head<2>() = in_heading(yaw, state.X_WB.p - target.p) +
                        gait_.options().capture_time * (in_heading(yaw, state.v_WB) - root_velocity_.head<2>());
  deviation.z() = wrapped_yaw(yaw_of(state.X_WB.R) - yaw);
  gait_.update(root_velocity_, deviation);
  track(reference);
  v_ = kTickRate * (q_ - last_q_);
  last_q_ = q_;
  last_root_ = root_;
}

Pose WbcTracker::led_root() const {
  const Eigen::Vector3d ahead = gait_.options().lead_time * gait_.velocity();
  const Eigen::Vector3d d_W = yaw_rotation(yaw_of(root_.R)) * Eigen::Vector3d(ahead.x(), ahead.y(), 0.0);
  return {yaw_rotation(ahead.z()) * root_.R, root_.p + d_W};
}

void WbcTracker::track(const Reference& reference) {
  root_ = within(reference.X_WB, bounds_);
  for (const int joint : upper_)
    q_[joint] = std::clamp(reference.q[joint], robot_->joints[joint].lower, robot_->joints[joint].upper);
  const double heading = yaw_of(root_.R);
  const std::array<FootPlace, 2> feet = gait_.feet();
  for (int side = 0; side < 2; ++side) {
    const Eigen::Quaterniond R_WH = yaw_rotation(heading);
    const Pose X_WF{R_WH * yaw_rotation(feet[side].yaw),
                    Eigen::Vector3d(root_.p.x(), root_.p.y(), 0.0) +
                        R_WH * Eigen::Vector3d(feet[side].x + foot_x_, feet[side].y, ankle_height_ + feet[side].lift)};
    Eigen::Matrix<double, 6, 1> q;
    for (int i = 0; i < 6; ++i) q[i] = q_[legs_[side].joints()[i]];
    legs_[side].solve(root_.inverse() * X_WF, q);
    for (int i = 0; i < 6; ++i) q_[legs_[side].joints()[i]] = q[i];
  }
}

}  // namespace duet
