#include "duet/backends/physics_backend.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>

#include "duet/backends/narrow_phase.h"

namespace duet {

PhysicsBackend::PhysicsBackend(const Scene& scene)
    : Backend(scene), pushes_(scene.robot->links.size()), narrow_phase_(scene), kinematics_(*this->scene().robot) {
  contacts_.reserve(narrow_phase_.capacity());
}

void PhysicsBackend::do_reset() {
  refuse_robot_overlap(scene(), state_);
  partner_ = {};
  pushes_.clear();
  place();
}

void PhysicsBackend::do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) {
  if (!partner_.present) refuse_partner_overlap(scene(), state_, joints);
  partner_.set(joints, velocities);
}

Outcome PhysicsBackend::do_step(const JointCommand& command) {
  const Outcome outcome = advance(command);
  partner_.advance(scene().dt);
  return outcome;
}

void PhysicsBackend::do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) {
  kinematics_.update(state_.X_WB, state_.q);
  pushes_.set(link, f_W, kinematics_.R_WL(link).transpose() * (p_W - kinematics_.p_WL(link)));
}

void PhysicsBackend::do_snapshot(Snapshot& snapshot) const {
  partner_.append_to(snapshot.values);
  pushes_.append_to(snapshot.values);
  append_to(snapshot.values);
}

void PhysicsBackend::do_restore(std::span<const double> values) {
  partner_.read_from(values.first(MovingPartner::kValues));
  pushes_.read_from(values.subspan(MovingPartner::kValues, pushes_.size()));
  read_from(values.subspan(MovingPartner::kValues + pushes_.size()));
}

void ExternalForces::clear() {
  std::fill(pushes_.begin(), pushes_.end(), Push{});
  any_ = false;
}

void ExternalForces::set(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L) {
  pushes_[link] = {f_W, p_L};
  any_ = true;
}

void ExternalForces::append_to(std::vector<double>& values) const {
  values.push_back(any_ ? 1.0 : 0.0);
  for (const Push& push : pushes_) {
    values.insert(values.end(), push.f_W.data(), push.f_W.data() + 3);
    values.insert(values.end(), push.p_L.data(), push.p_L.data() + 3);
  }
}

void ExternalForces::read_from(std::span<const double> values) {
  any_ = values[0] != 0.0;
  const double* from = values.data() + 1;
  for (Push& push : pushes_) {
    push = {Eigen::Vector3d(from), Eigen::Vector3d(from + 3)};
    from += 6;
  }
}

double thread_cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

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
