#include "duet/backends/ode/ode_stepper.h"

#include <algorithm>

#include "duet/backends/backend.h"
#include "duet/backends/ode/ode_world.h"

namespace duet {
namespace {

// Share of the bound on friction below which a contact is foreseen to stick.
constexpr double kSticks = 0.95;

ConstraintSoftness softness_of(const ContactPoint& point, const OdeOptions& options, double dt) {
  if (point.side != ContactSide::kHuman) return options.contact;
  return spring_damper(point.skin.stiffness, point.skin.damping, dt);
}

}  // namespace

OdeStepper::OdeStepper(const Scene& scene, std::size_t contacts)
    : robot_(scene.robot),
      dt_(scene.dt),
      options_(ode_options(scene.options)),
      law_(scene),
      forecast_(*robot_, contacts, scene.dt, options_.sweeps),
      world_((enter_ode(), scene), options_, contacts),
      stuck_(contacts, 0),
      before_(world_.size()) {
  const int n = 6 + robot_->dof();
  Q_ = v_before_ = v_ = a_ = Eigen::VectorXd::Zero(n);
  tau_ = Eigen::VectorXd::Zero(robot_->dof());
  push_jacobian_ = Eigen::MatrixXd::Zero(3, n);
}

bool OdeStepper::advance(const JointCommand& command, std::span<const ContactPoint> points,
                         const ExternalForces* pushes, RobotState& state) {
  if (!foresee(state, command, points, pushes)) return false;
  world_.write_to(before_);
  step(points, pushes, !options_.stick);
  if (!all_stuck(points)) {
    world_.read_from(before_);
    step(points, pushes, true);
  }
  if (!world_.sane()) return false;
  world_.read(state);
  return true;
}

bool OdeStepper::foresee(const RobotState& state, const JointCommand& command, std::span<const ContactPoint> points,
                         const ExternalForces* pushes) {
  if (!law_.begin(state, command)) return false;
  Q_.setZero();
  if (pushes != nullptr) add_pushes(*pushes);
  v_before_ << state.v_WB, state.w_WB_B, state.v;
  foresee_free();
  forecast_.clear();
  for (const ContactPoint& point : points)
    forecast_.add(point, softness_of(point, options_, dt_), options_.contact.cfm, world_.rotations(),
                  world_.positions(), v_);
  add_stops(state);
  foresee_contacts();
  if (law_.saturate(a_)) {
    foresee_free();
    foresee_contacts();
  }
  law_.equivalent_torques(a_, tau_);
  add_stop_torques();
  return v_.allFinite() && v_.cwiseAbs().maxCoeff() < kDivergedSpeed;
}

void OdeStepper::foresee_free() {
  law_.forces(Q_, a_);
  law_.factor().solve(a_);
  v_ = v_before_ + dt_ * a_;
}

void OdeStepper::foresee_contacts() {
  if (forecast_.empty()) return;
  forecast_.solve(law_.factor(), v_);
  a_ = (v_ - v_before_) / dt_;
}

void OdeStepper::add_stops(const RobotState& state) {
  for (int i = 0; i < robot_->dof(); ++i) {
    const double below = robot_->joints[i].lower - state.q[i], above = state.q[i] - robot_->joints[i].upper;
    if (below >= 0.0)
      forecast_.add_stop(i, 1.0, below, options_.stop);
    else if (above >= 0.0)
      forecast_.add_stop(i, -1.0, above, options_.stop);
  }
}

// Where a range is so wide that ODE has no stop for it, the one that is foreseen acts as a torque.
void OdeStepper::add_stop_torques() {
  for (int i = 0; i < robot_->dof(); ++i)
    if (!world_.has_stop(i)) tau_[i] += forecast_.stop_impulse(i) / dt_;
}

void OdeStepper::add_pushes(const ExternalForces& pushes) {
  for (int link = 0; link < static_cast<int>(pushes.all().size()); ++link) {
    const ExternalForces::Push& push = pushes.all()[link];
    if (push.f_W.isZero(0.0)) continue;
    const Eigen::Vector3d p_W = world_.positions()[link] + world_.rotations()[link] * push.p_L;
    law_.kinematics().point_jacobian(link, p_W, push_jacobian_);
    Q_.noalias() += push_jacobian_.transpose() * push.f_W;
  }
}

void OdeStepper::step(std::span<const ContactPoint> points, const ExternalForces* pushes, bool all_bounded) {
  world_.clear_contacts();
  for (std::size_t i = 0; i < points.size(); ++i) world_.add_contact(contact(points[i], i, all_bounded));
  for (int i = 0; i < robot_->dof(); ++i) world_.add_torque(i, tau_[i]);
  if (pushes != nullptr)
    for (int link = 0; link < static_cast<int>(pushes->all().size()); ++link)
      if (const ExternalForces::Push& push = pushes->all()[link]; !push.f_W.isZero(0.0))
        world_.add_force(link, push.f_W, push.p_L);
  world_.step();
}

OdeContact OdeStepper::contact(const ContactPoint& point, std::size_t i, bool all_bounded) {
  const Eigen::Vector3d force = forecast_.impulse(i) / dt_;
  const double bound = point.friction * std::max(0.0, force.x());
  stuck_[i] =
      static_cast<char>(!all_bounded && point.side == ContactSide::kGround && force.tail<2>().norm() < kSticks * bound);
  const Eigen::Matrix3d& axes_W = forecast_.axes_W(i);
  return {.link = point.link,
          .other = point.side == ContactSide::kRobot ? point.other : -1,
          .p_W = point.p_W,
          .axes_W = axes_W,
          .velocity = axes_W.transpose() * point.v_other_W,
          .depth = point.depth,
          .softness = softness_of(point, options_, dt_),
          .slip = options_.contact.cfm,
          .friction_bound = bound,
          .stuck = stuck_[i] != 0};
}

bool OdeStepper::all_stuck(std::span<const ContactPoint> points) const {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (stuck_[i] == 0) continue;
    const Eigen::Vector3d force_W = world_.contact_force(i);
    const double normal = force_W.dot(points[i].n_W);
    if ((force_W - normal * points[i].n_W).norm() > points[i].friction * normal) return false;
  }
  return true;
}

}  // namespace duet
