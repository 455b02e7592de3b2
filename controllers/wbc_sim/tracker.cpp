#include "duet/controllers/wbc_sim/tracker.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/controllers/stance.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"

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

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kSteps = 3;           // at most
constexpr double kExact = 1e-9;     // error that is none [m]
constexpr double kDamping = 1e-4;   // of J^T J; keeps a stretched knee from turning over [m^2]
constexpr double kLongest = 0.3;    // step of one joint [rad]
constexpr double kRotation = 0.15;  // a radian of the foot's orientation weighs as much as this [m]

// The rotation vector that turns A into B, both seen from the base.
Eigen::Vector3d turn(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  const Eigen::AngleAxisd difference(Eigen::Matrix3d(B * A.transpose()));
  return difference.angle() * difference.axis();
}

}  // namespace

LegChain::LegChain(const RobotModel& robot, const Leg& leg) : joints_(leg.joints) {
  require(leg.joints.size() == 6, "robot '{}': leg of '{}' has {} joints, expected 6", robot.name,
          robot.links[leg.link].name, leg.joints.size());
  for (const int joint : joints_) {
    const RobotLink& link = robot.links[joint + 1];
    hinges_.push_back({.R_PL0 = link.X_PL.R.toRotationMatrix(),
                       .p_PL = link.X_PL.p,
                       .axis = link.axis,
                       .lower = robot.joints[joint].lower,
                       .upper = robot.joints[joint].upper});
  }
}

LegChain::Placed LegChain::place(const Vector6& q) const {
  Placed placed;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int i = 0; i < 6; ++i) {
    p += R * hinges_[i].p_PL;
    R = R * hinges_[i].R_PL0 * Eigen::AngleAxisd(q[i], hinges_[i].axis);
    placed.axes.col(i) = R * hinges_[i].axis;
    placed.origins.col(i) = p;
  }
  placed.R_BF = R;
  placed.p_BF = p;
  return placed;
}

Pose LegChain::foot_pose(const Vector6& q) const {
  const Placed placed = place(q);
  return {Eigen::Quaterniond(placed.R_BF), placed.p_BF};
}

void LegChain::solve(const Pose& X_BF, Vector6& q) const {
  const Eigen::Matrix3d R_BF = X_BF.R.toRotationMatrix();
  for (int step = 0; step < kSteps; ++step) {
    const Placed placed = place(q);
    Vector6 error;
    error << X_BF.p - placed.p_BF, kRotation * turn(placed.R_BF, R_BF);
    if (error.squaredNorm() < kExact * kExact) return;
    Matrix6 J;
    for (int i = 0; i < 6; ++i) {
      J.col(i).head<3>() = placed.axes.col(i).cross(placed.p_BF - placed.origins.col(i));
      J.col(i).tail<3>() = kRotation * placed.axes.col(i);
    }
    const Matrix6 normal = J.transpose() * J + kDamping * Matrix6::Identity();
    const Vector6 dq = normal.ldlt().solve(J.transpose() * error);
    for (int i = 0; i < 6; ++i)
      q[i] = std::clamp(q[i] + std::clamp(dq[i], -kLongest, kLongest), hinges_[i].lower, hinges_[i].upper);
  }
}

namespace {

constexpr double kFilter = kTick / 0.15;  // of the reference's velocity
constexpr int kHalfCyclesAtRest = 2;      // in which the feet come together before they stand

}  // namespace

void Gait::reset() { *this = Gait(options_); }

void Gait::update(const Eigen::Vector3d& velocity, const Eigen::Vector3d& deviation) {
  velocity_ += kFilter * (velocity - velocity_);
  const double speed = velocity_.head<2>().norm();
  if (speed > options_.max_speed) velocity_.head<2>() *= options_.max_speed / speed;
  velocity_.z() = std::clamp(velocity_.z(), -options_.max_turn, options_.max_turn);

  const bool wanted =
      velocity_.head<2>().norm() > options_.still_speed || std::abs(velocity_.z()) > options_.still_turn ||
      deviation.head<2>().norm() > options_.start_distance || std::abs(deviation.z()) > options_.start_angle;
  if (!stepping_) {
    if (wanted) start(deviation);
    return;
  }
  const double before = phase_;
  phase_ += kTick * options_.frequency;
  share_ = std::min(1.0, share_ + kTick / half_period());
  const bool switched = (before < 0.5) != (phase_ < 0.5) || phase_ >= 1.0;
  if (phase_ >= 1.0) phase_ -= 1.0;
  if (!switched) return;
  resting_ = wanted ? 0 : resting_ + 1;
  if (resting_ > kHalfCyclesAtRest) stepping_ = false;
}

// The first foot to leave the ground is the one on the side that the robot goes to.
void Gait::start(const Eigen::Vector3d& deviation) {
  const double side = velocity_.y() + 0.3 * velocity_.z() + 2.0 * deviation.y();
  phase_ = side >= 0.0 ? 0.0 : 0.5;
  share_ = 0.0;
  resting_ = 0;
  stepping_ = true;
}

std::array<FootPlace, 2> Gait::feet() const { return {foot(0), foot(1)}; }

// In stance a foot stays where it is while the root passes over it; in swing it goes from half a step behind to half a
// step ahead. Turns rotate the place about the root.
FootPlace Gait::foot(int side) const {
  const double sign = side == 0 ? 1.0 : -1.0;
  if (!stepping_) return {.x = 0.0, .y = sign * options_.half_width};
  const double progress = swing_progress();
  const bool swings = side == swing_foot();
  const double ahead = (swings ? smooth_step(progress) - 0.5 : 0.5 - progress) * half_period();  // [s]
  const double yaw = velocity_.z() * ahead;
  FootPlace place;
  place.x = velocity_.x() * ahead - std::sin(yaw) * sign * options_.half_width;
  place.y = velocity_.y() * ahead + std::cos(yaw) * sign * options_.half_width;
  place.yaw = yaw;
  if (swings) place.lift = share_ * options_.swing_height * 0.5 * (1.0 - std::cos(2.0 * std::numbers::pi * progress));
  return place;
}

}  // namespace duet
