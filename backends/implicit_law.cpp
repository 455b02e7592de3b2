#include "duet/backends/implicit_law.h"

#include <cmath>
#include <stdexcept>

namespace duet {

ImplicitLaw::ImplicitLaw(const Scene& scene)
    : robot_(scene.robot),
      dt_(scene.dt),
      dynamics_(*robot_, scene.gravity),
      mass_(&dynamics_.mass()),
      bias_(&dynamics_.bias()),
      factor_(*robot_),
      drive_(Eigen::VectorXd::Zero(robot_->dof())),
      inertia_(Eigen::VectorXd::Zero(robot_->dof())),
      a_(Eigen::VectorXd::Zero(6 + robot_->dof())) {}

bool ImplicitLaw::begin(const RobotState& state, const JointCommand& command) {
  dynamics_.update(state);
  return begin(state, command, dynamics_.mass(), dynamics_.bias());
}

bool ImplicitLaw::begin(const RobotState& state, const JointCommand& command, const Eigen::MatrixXd& mass,
                        const Eigen::VectorXd& bias) {
  mass_ = &mass;
  bias_ = &bias;
  for (int i = 0; i < robot_->dof(); ++i) {
    const double kp = command.kp[i], kd = command.kd[i];
    inertia_[i] = robot_->joints[i].armature + dt_ * kd + dt_ * dt_ * kp;
    drive_[i] = kp * (command.q_target[i] - state.q[i] - dt_ * state.v[i]) - kd * state.v[i] + command.tau_ff[i];
  }
  return factor_.compute(mass, inertia_);
}

void ImplicitLaw::forces(const Eigen::VectorXd& Q, Eigen::VectorXd& out) const {
  out = Q - *bias_;
  out.tail(robot_->dof()) += drive_;
}

void ImplicitLaw::solve(const Eigen::VectorXd& Q) {
  forces(Q, a_);
  factor_.solve(a_);
  if (!saturate(a_)) return;
  forces(Q, a_);
  factor_.solve(a_);
}

bool ImplicitLaw::saturate(const Eigen::VectorXd& a) {
  bool changed = false;
  for (int i = 0; i < robot_->dof(); ++i) {
    const RobotJoint& joint = robot_->joints[i];
    const double torque = drive_[i] - (inertia_[i] - joint.armature) * a[6 + i];
    if (std::abs(torque) <= joint.effort) continue;
    drive_[i] = std::copysign(joint.effort, torque);
    inertia_[i] = joint.armature;
    changed = true;
  }
  if (changed && !factor_.compute(*mass_, inertia_))
    throw std::runtime_error("the mass matrix is not positive definite");
  return changed;
}

void ImplicitLaw::equivalent_torques(const Eigen::VectorXd& a, Eigen::VectorXd& out) const {
  out = drive_ - inertia_.cwiseProduct(a.tail(robot_->dof()));
}

void ImplicitLaw::torques(const Eigen::VectorXd& a, Eigen::VectorXd& out) const {
  for (int i = 0; i < robot_->dof(); ++i) out[i] = drive_[i] - (inertia_[i] - robot_->joints[i].armature) * a[6 + i];
}

}  // namespace duet
