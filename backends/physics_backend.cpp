#include "duet/backends/physics_backend.h"

#include "duet/backends/start_overlap.h"

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

}  // namespace duet
