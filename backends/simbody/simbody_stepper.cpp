#include "duet/backends/simbody/simbody_stepper.h"

#include <Eigen/Geometry>
#include <array>

namespace duet {
namespace {

constexpr double kSmallAngle = 1e-9;  // [rad]

// The rotation by the vector `turn`, angle times axis.
Eigen::Quaterniond rotation_of(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle < kSmallAngle) return Eigen::Quaterniond(1.0, 0.5 * turn.x(), 0.5 * turn.y(), 0.5 * turn.z());
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle));
}

}  // namespace

SimbodyStepper::SimbodyStepper(const Scene& scene, std::size_t contacts)
    : robot_(scene.robot),
      dt_(scene.dt),
      settings_(simbody_settings(scene.options)),
      rigid_(spring_damper(settings_.contact_stiffness, settings_.contact_damping, scene.dt)),
      model_(scene.robot, scene.gravity),
      law_(scene),
      contacts_(*robot_, contacts, scene.dt, settings_.sweeps),
      no_force_(Eigen::VectorXd::Zero(6 + robot_->dof())),
      v_begin_(no_force_),
      v_(no_force_),
      a_(no_force_) {}

bool SimbodyStepper::step(RobotState& state, const JointCommand& command, const ExternalForces& pushes,
                          const MovingPartner& partner, NarrowPhase& narrow_phase) {
  model_.update(state);
  if (pushes.any()) apply(pushes);
  const std::span<const ContactPoint> points = narrow_phase.collide(model_.rotations(), model_.positions(), partner);
  v_begin_ << state.v_WB, state.w_WB_B, state.v;
  if (!law_.begin(state, command, model_.mass(), model_.update_bias())) return false;
  solve(state, points);
  if (law_.saturate(a_)) solve(state, points);
  advance(state);
  return true;
}

void SimbodyStepper::apply(const ExternalForces& pushes) {
  for (std::size_t link = 0; link < pushes.all().size(); ++link)
    model_.apply(static_cast<int>(link), pushes.all()[link].f_W, pushes.all()[link].p_L);
}

// Velocity and acceleration under the law as it stands.
void SimbodyStepper::solve(const RobotState& state, std::span<const ContactPoint> points) {
  law_.forces(no_force_, a_);
  law_.factor().solve(a_);
  v_ = v_begin_ + dt_ * a_;
  contacts_.clear();
  for (const ContactPoint& point : points) {
    const bool human = point.side == ContactSide::kHuman;
    contacts_.add(point, human ? spring_damper(point.skin.stiffness, point.skin.damping, dt_) : rigid_,
                  model_.rotations(), model_.positions());
  }
  add_stops(state);
  if (contacts_.size() == 0) return;
  contacts_.solve(law_.factor(), v_);
  a_ = (v_ - v_begin_) / dt_;
}

// Adds the stops of joints that would end the step beyond one.
void SimbodyStepper::add_stops(const RobotState& state) {
  const ConstraintSoftness soft = {.erp = settings_.stop_erp, .cfm = 0.0};
  for (int i = 0; i < robot_->dof(); ++i) {
    const RobotJoint& joint = robot_->joints[i];
    const double next = state.q[i] + dt_ * v_[6 + i];
    if (next < joint.lower)
      contacts_.add_stop(i, 1.0, joint.lower - state.q[i], soft);
    else if (next > joint.upper)
      contacts_.add_stop(i, -1.0, state.q[i] - joint.upper, soft);
  }
}

void SimbodyStepper::advance(RobotState& state) const {
  state.v_WB = v_.head<3>();
  state.w_WB_B = v_.segment<3>(3);
  state.v = v_.tail(robot_->dof());
  state.X_WB.p += dt_ * state.v_WB;
  state.X_WB.R = (state.X_WB.R * rotation_of(dt_ * state.w_WB_B)).normalized();
  state.q += dt_ * state.v;
}

std::span<const EngineOption> simbody_options() {
  static const std::array<EngineOption, 4> options = {
      number_option("contact_stiffness", 5e5, 1e3, 1e9, "spring of a contact point on the ground or a link [N/m]"),
      number_option("contact_damping", 1e4, 0.0, 1e6, "its damper [N s/m]"),
      number_option("stop_erp", 0.2, 0.0, 1.0, "share of a passed joint stop that one step removes"),
      integer_option("sweeps", 60, 1, 10000, "most sweeps of the contact solver where contacts slide or open")};
  return options;
}

SimbodySettings simbody_settings(const EngineOptions& options) {
  const std::span<const EngineOption> known = simbody_options();
  check_options("simbody", options, known);
  return {.contact_stiffness = option_number(options, known, "contact_stiffness"),
          .contact_damping = option_number(options, known, "contact_damping"),
          .stop_erp = option_number(options, known, "stop_erp"),
          .sweeps = option_integer(options, known, "sweeps")};
}

}  // namespace duet
