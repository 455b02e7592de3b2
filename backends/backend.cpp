#include "duet/backends/backend.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kUnitTolerance = 1e-6;

void check_link(const RobotLink& link) {
  require(std::isfinite(link.mass) && link.mass > 0.0, "Scene: link '{}' has mass {} kg, expected more than 0",
          link.name, link.mass);
  require(link.inertia.allFinite() && link.inertia.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() > 0.0,
          "Scene: the inertia of link '{}' is not positive definite", link.name);
}

Scene checked(Scene scene) {
  require(scene.robot != nullptr, "Scene: no robot");
  require(scene.dt > 0.0 && scene.dt <= 0.02, "Scene: dt is {} s, expected in (0, 0.02]", scene.dt);
  const auto not_negative = [](double value, const char* name) {
    require(std::isfinite(value) && value >= 0.0, "Scene: {} is {}, expected finite and >= 0", name, value);
  };
  not_negative(scene.friction.robot_ground, "friction robot_ground");
  not_negative(scene.friction.robot_human, "friction robot_human");
  not_negative(scene.friction.robot_robot, "friction robot_robot");
  for (const HumanCapsule& capsule : scene.human.capsules) {
    not_negative(capsule.skin.stiffness, "skin stiffness");
    not_negative(capsule.skin.damping, "skin damping");
  }
  require(scene.gravity.allFinite(), "Scene: gravity is not finite");
  for (const RobotLink& link : scene.robot->links) check_link(link);
  return scene;
}

// The fast path is a comparison and a sum; the message is made only where it is needed.
void check_vector(const Eigen::VectorXd& values, const RobotModel& robot, const char* what, bool negative_allowed) {
  if (values.size() != robot.dof())
    throw std::invalid_argument(fmt::format("{} has {} entries, expected {} (one per joint of {})", what, values.size(),
                                            robot.dof(), robot.name));
  for (int i = 0; i < robot.dof(); ++i) {
    if (std::isfinite(values[i]) && (negative_allowed || values[i] >= 0.0)) continue;
    throw std::invalid_argument(fmt::format("{} of joint '{}' is {}, expected {}", what, robot.joints[i].name,
                                            values[i], negative_allowed ? "a finite number" : "finite and >= 0"));
  }
}

void check_pose(const Pose& pose, const char* what) {
  if (!pose.p.allFinite() || !pose.R.coeffs().allFinite())
    throw std::invalid_argument(fmt::format("{}: the pose of the base is not finite", what));
  if (std::abs(pose.R.norm() - 1.0) > kUnitTolerance)
    throw std::invalid_argument(
        fmt::format("{}: the quaternion of the base has norm {}, expected 1", what, pose.R.norm()));
}

bool all_finite(const RobotState& state) {
  return state.X_WB.p.allFinite() && state.X_WB.R.coeffs().allFinite() && state.v_WB.allFinite() &&
         state.w_WB_B.allFinite() && state.q.allFinite() && state.v.allFinite();
}

// Copies equal sizes: no allocation.
void assign(RobotState& to, const RobotState& from) {
  to.X_WB = from.X_WB;
  to.v_WB = from.v_WB;
  to.w_WB_B = from.w_WB_B;
  to.q = from.q;
  to.v = from.v;
}

template <typename Vector>
void append(std::vector<double>& values, const Vector& vector) {
  values.insert(values.end(), vector.data(), vector.data() + vector.size());
}

template <typename Vector>
const double* take(const double* from, Vector& vector) {
  for (Eigen::Index i = 0; i < vector.size(); ++i) vector.data()[i] = from[i];
  return from + vector.size();
}

}  // namespace

bool speeds_are_sane(const RobotState& state) {
  const auto sane = [](const auto& v) { return (v.array().abs() < kDivergedSpeed).all(); };
  return sane(state.v_WB) && sane(state.w_WB_B) && sane(state.v);
}

Backend::Backend(Scene scene) : scene_(checked(std::move(scene))) {
  const int n = scene_.robot->dof();
  state_.q = Eigen::VectorXd::Zero(n);
  state_.v = Eigen::VectorXd::Zero(n);
  torques_ = Eigen::VectorXd::Zero(n);
  last_finite_ = state_;
  held_ = {state_.q, state_.q, state_.q, state_.q};
}

// fmin and fmax leave no NaN: gains near the largest number may give one.
const JointCommand& Backend::held_torque(const JointCommand& command) {
  for (int i = 0; i < scene_.robot->dof(); ++i) {
    const double torque =
        command.kp[i] * (command.q_target[i] - state_.q[i]) - command.kd[i] * state_.v[i] + command.tau_ff[i];
    const double effort = scene_.robot->joints[i].effort;
    held_.tau_ff[i] = std::fmin(std::fmax(torque, -effort), effort);
  }
  return held_;
}

void Backend::reset(const RobotState& state) {
  check_pose(state.X_WB, "Backend::reset");
  require(state.v_WB.allFinite() && state.w_WB_B.allFinite(), "Backend::reset: the velocity of the base is not finite");
  check_vector(state.q, *scene_.robot, "Backend::reset: q", true);
  check_vector(state.v, *scene_.robot, "Backend::reset: v", true);
  state_ = state;
  contacts_.clear();
  torques_.setZero();
  steps_ = 0;
  diverged_ = false;
  do_reset();
}

void Backend::set_partner(const HumanJoints& joints, const HumanJoints& velocities) {
  if (!joints.allFinite() || !velocities.allFinite())
    throw std::invalid_argument("Backend::set_partner: a joint's position or velocity is not finite");
  do_set_partner(joints, velocities);
}

Outcome Backend::step(const JointCommand& command) {
  check_vector(command.q_target, *scene_.robot, "Backend::step: q_target", true);
  check_vector(command.kp, *scene_.robot, "Backend::step: kp", false);
  check_vector(command.kd, *scene_.robot, "Backend::step: kd", false);
  check_vector(command.tau_ff, *scene_.robot, "Backend::step: tau_ff", true);
  if (diverged_) return Outcome::kDiverged;
  assign(last_finite_, state_);
  const Outcome outcome = do_step(scene_.law == TorqueLaw::kExplicit ? held_torque(command) : command);
  ++steps_;
  if (outcome != Outcome::kDiverged && all_finite(state_)) return outcome;
  diverged_ = true;
  assign(state_, last_finite_);
  contacts_.clear();
  return Outcome::kDiverged;
}

Snapshot Backend::snapshot() const {
  Snapshot snapshot;
  std::vector<double>& values = snapshot.values;
  values = {static_cast<double>(steps_), diverged_ ? 1.0 : 0.0};
  append(values, state_.X_WB.p);
  append(values, state_.X_WB.R.coeffs());
  append(values, state_.v_WB);
  append(values, state_.w_WB_B);
  append(values, state_.q);
  append(values, state_.v);
  append(values, torques_);
  do_snapshot(snapshot);
  return snapshot;
}

void Backend::restore(const Snapshot& snapshot) {
  const size_t expected = this->snapshot().values.size();
  require(snapshot.values.size() == expected,
          "Backend::restore: the snapshot has {} values, expected {} for this scene in {}", snapshot.values.size(),
          expected, name());
  const double* from = snapshot.values.data();
  steps_ = static_cast<long>(from[0]);
  diverged_ = from[1] != 0.0;
  from = take(from + 2, state_.X_WB.p);
  from = take(from, state_.X_WB.R.coeffs());
  from = take(from, state_.v_WB);
  from = take(from, state_.w_WB_B);
  from = take(from, state_.q);
  from = take(from, state_.v);
  from = take(from, torques_);
  contacts_.clear();
  do_restore({from, snapshot.values.data() + expected});
}

void Backend::push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) {
  const int links = static_cast<int>(scene_.robot->links.size());
  if (link < 0 || link >= links)
    throw std::invalid_argument(
        fmt::format("Backend::push: link {} of {}, expected 0 to {}", link, scene_.robot->name, links - 1));
  require(f_W.allFinite() && p_W.allFinite(), "Backend::push: force or point is not finite");
  do_push(link, f_W, p_W);
}

void Backend::kick(const Eigen::Vector3d& dv_W) {
  require(dv_W.allFinite(), "Backend::kick: the velocity is not finite");
  if (diverged_) return;
  state_.v_WB += dv_W;
  do_kick(dv_W);
}

}  // namespace duet
