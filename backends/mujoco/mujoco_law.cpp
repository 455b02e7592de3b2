#include "duet/backends/mujoco/mujoco_law.h"

#include <mujoco/mujoco.h>

#include <cmath>

namespace duet {

MujocoLaw::MujocoLaw(const Scene& scene, const MujocoModel& compiled)
    : scene_(scene),
      compiled_(compiled),
      drive_(Eigen::VectorXd::Zero(scene.robot->dof())),
      added_(Eigen::VectorXd::Zero(scene.robot->dof())) {}

void MujocoLaw::begin(const RobotState& state, const JointCommand& command) {
  const double dt = scene_.dt;
  for (int i = 0; i < drive_.size(); ++i) {
    const double kp = command.kp[i], kd = command.kd[i];
    const int v = compiled_.v_address[i];
    added_[i] = dt * (kd + dt * kp);
    drive_[i] = kp * (command.q_target[i] - state.q[i] - dt * state.v[i]) - kd * state.v[i] + command.tau_ff[i];
    compiled_.model->dof_armature[v] = scene_.robot->joints[i].armature + added_[i];
    compiled_.data->qfrc_applied[v] = drive_[i];
  }
}

void MujocoLaw::accelerate() {
  const mjModel* const m = compiled_.model.get();
  mjData* const d = compiled_.data.get();
  mj_fwdAcceleration(m, d);
  mj_fwdConstraint(m, d);
  if (!saturate()) return;
  mj_factorM(m, d);
  if (m->opt.solver == mjSOL_PGS) mj_projectConstraint(m, d);
  mj_fwdAcceleration(m, d);
  mj_fwdConstraint(m, d);
}

bool MujocoLaw::saturate() {
  bool changed = false;
  mjData& d = *compiled_.data;
  for (int i = 0; i < drive_.size(); ++i) {
    const int v = compiled_.v_address[i];
    const double effort = scene_.robot->joints[i].effort;
    const double torque = drive_[i] - added_[i] * d.qacc[v];
    if (std::abs(torque) <= effort) continue;
    drive_[i] = d.qfrc_applied[v] = std::copysign(effort, torque);
    d.qM[compiled_.model->dof_Madr[v]] -= added_[i];
    compiled_.model->dof_armature[v] = scene_.robot->joints[i].armature;
    added_[i] = 0.0;
    changed = true;
  }
  return changed;
}

// MuJoCo's implicit integrator has no function of its own: mj_step2 solves the step once more and then takes it.
void MujocoLaw::integrate() {
  mjModel* const m = compiled_.model.get();
  mjData* const d = compiled_.data.get();
  if (m->opt.integrator != mjINT_EULER) return mj_step2(m, d);
  mj_checkAcc(m, d);
  mj_Euler(m, d);
}

void MujocoLaw::torques(const Eigen::VectorXd& v_before, const Eigen::VectorXd& v_after, Eigen::VectorXd& out) const {
  out = drive_ - added_.cwiseProduct(v_after - v_before) / scene_.dt;
}

}  // namespace duet
