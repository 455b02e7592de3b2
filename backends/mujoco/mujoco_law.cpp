#include "duet/backends/mujoco/mujoco_law.h"

#include <mujoco/mujoco.h>

#include <algorithm>
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

namespace {

constexpr double kLeastMass = 1e-9;  // [kg], of a skin without spring and damper

bool same_geoms(const mjContact& a, const mjContact& b) { return a.geom1 == b.geom1 && a.geom2 == b.geom2; }

// Points of the pair of geoms that contact `index` belongs to; they stand side by side. A capsule has one or two.
int points_of_pair(const mjData& d, int index) {
  const mjContact& contact = d.contact[index];
  return 1 + static_cast<int>(index > 0 && same_geoms(contact, d.contact[index - 1])) +
         static_cast<int>(index + 1 < d.ncon && same_geoms(contact, d.contact[index + 1]));
}

// Relative velocity that the partner adds to row k of a contact, per direction of its frame.
double row_velocity(const mjContact& contact, int row, bool pyramidal, const Eigen::Vector3d& along) {
  if (!pyramidal) return along[row];
  const int tangent = row / 2;
  return along[0] + (row % 2 == 0 ? 1.0 : -1.0) * contact.friction[tangent] * along[1 + tangent];
}

void set_rows(const mjModel& m, mjData& d, const mjContact& contact, const ContactCompliance& skin,
              const Eigen::Vector3d& along) {
  const double dt = m.opt.timestep;
  const bool pyramidal = m.opt.cone == mjCONE_PYRAMIDAL;
  const double damping = skin.damping + dt * skin.stiffness;
  const double R = 1.0 / std::max(dt * damping, kLeastMass);
  const int rows = pyramidal ? 2 * (contact.dim - 1) : contact.dim;
  for (int k = 0; k < rows; ++k) {
    const int row = contact.efc_address + k;
    const bool spring = pyramidal || k == 0;
    const double row_R = pyramidal ? rows * R : k == 0 ? R : R / m.opt.impratio;
    const double velocity = d.efc_vel[row] + row_velocity(contact, k, pyramidal, along);
    if (m.opt.solver == mjSOL_PGS) d.efc_AR[row * (d.nefc + 1)] += row_R - d.efc_R[row];
    d.efc_R[row] = row_R;
    d.efc_D[row] = 1.0 / row_R;
    d.efc_aref[row] = -velocity / dt - (spring ? skin.stiffness * R * contact.dist : 0.0);
  }
}

}  // namespace

void set_skin_rows(const Scene& scene, const MovingPartner& partner, const MujocoModel& compiled) {
  if (!partner.present || compiled.human_geom.empty()) return;
  mjData& d = *compiled.data;
  for (int i = 0; i < d.ncon; ++i) {
    const mjContact& contact = d.contact[i];
    const bool first_is_human = compiled.geoms[contact.geom1].side == ContactSide::kHuman;
    const MujocoGeom& human = compiled.geoms[first_is_human ? contact.geom1 : contact.geom2];
    if (human.side != ContactSide::kHuman || contact.efc_address < 0) continue;
    const HumanCapsule& capsule = scene.human.capsules[human.index];
    const int points = points_of_pair(d, i);
    const ContactCompliance skin{capsule.skin.stiffness / points, capsule.skin.damping / points};
    const Eigen::Vector3d v_W = capsule_velocity(capsule, partner, Eigen::Vector3d(contact.pos));
    // The rows of the frame are the normal and two tangents; velocities are those of the second geom.
    const Eigen::Vector3d along = Eigen::Map<const Eigen::Matrix3d>(contact.frame).transpose() * v_W;
    set_rows(*compiled.model, d, contact, skin, first_is_human ? Eigen::Vector3d(-along) : along);
  }
}

}  // namespace duet
