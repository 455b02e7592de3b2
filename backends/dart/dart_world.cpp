#include "duet/backends/dart/dart_world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <dart/collision/dart/DARTCollisionDetector.hpp>
#include <dart/constraint/DantzigBoxedLcpSolver.hpp>
#include <dart/constraint/PgsBoxedLcpSolver.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>

#include "duet/backends/backend.h"
#include "duet/backends/dart/contact_rows.h"
#include "duet/backends/dart/link_responses.h"

namespace duet {
namespace {

using dart::dynamics::BodyNode;
using dart::dynamics::FreeJoint;
using dart::dynamics::Joint;
using dart::dynamics::Skeleton;

// Limits beyond which, as beyond kDivergedSpeed, a run has diverged. Debian's libdart ends the process at the first NaN
// (assertions are on in it), so nothing that could overflow may reach it.
constexpr double kFarthest = 1e9;    // [m], [rad]
constexpr double kStrongest = 1e15;  // [N], [N m]

Eigen::Isometry3d isometry(const Pose& pose) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = pose.R.normalized().toRotationMatrix();
  X.translation() = pose.p;
  return X;
}

std::unique_ptr<GroupSolver> make_solver(const Scene& scene) {
  namespace dc = dart::constraint;
  const auto pgs = std::make_shared<dc::PgsBoxedLcpSolver>();
  pgs->setOption(dc::PgsBoxedLcpSolver::Option(option_integer(scene.options, dart_options(), "pgs_iterations")));
  const bool dantzig = option_choice(scene.options, dart_options(), "solver") == "dantzig";
  const int passes = option_integer(scene.options, dart_options(), "friction_passes");
  auto solver =
      dantzig ? std::make_unique<GroupSolver>(std::make_shared<dc::DantzigBoxedLcpSolver>(), pgs, scene.dt, passes)
              : std::make_unique<GroupSolver>(pgs, nullptr, scene.dt, passes);
  solver->setCollisionDetector(dart::collision::DARTCollisionDetector::create());  // without shapes the cheapest
  return solver;
}

bool positions_are_sensible(const RobotState& state) {
  return state.X_WB.p.cwiseAbs().sum() < kFarthest && state.q.cwiseAbs().sum() < kFarthest;
}

RigidContact rigid_contact(const EngineOptions& options) {
  return {.erp = option_number(options, dart_options(), "erp"),
          .recovery_speed = option_number(options, dart_options(), "recovery_speed"),
          .cfm = option_number(options, dart_options(), "cfm")};
}

}  // namespace

std::span<const EngineOption> dart_options() {
  static const std::vector<EngineOption> options = {
      choice_option("solver", {"dantzig", "pgs"}, "of the contact problem; dantzig falls back on pgs"),
      integer_option("pgs_iterations", 50, 1, 10000, "sweeps of pgs"),
      integer_option("friction_passes", 5, 0, 100,
                     "solutions that refine the bounds of friction; 0: DART's own bounds"),
      number_option("erp", 0.2, 0.0, 1.0, "share of a rigid contact's depth that is recovered in a step"),
      number_option("recovery_speed", 0.05, 0.0, 10.0, "at most, of a rigid contact [m/s]"),
      number_option("cfm", 0.03, 0.0, 1.0,
                    "softness of a rigid contact along its normal, as a share of its inertia^-1")};
  return options;
}

DartWorld::DartWorld(const Scene& scene, std::size_t contact_capacity)
    : robot_(scene.robot), dt_(scene.dt), solver_(make_solver(scene)), law_(scene.robot->joints.size()) {
  build(scene);
  stops_.reserve(hinges_.size());
  rows_ = std::make_shared<ContactRows>(skeleton_, bodies_, LinkResponses(robot_, bodies_, hinges_),
                                        rigid_contact(scene.options), dt_, contact_capacity);
  solver_->addSkeleton(skeleton_);
  solver_->getCollisionGroup()->unsubscribeFrom(skeleton_.get());
  solver_->addConstraint(rows_);
}

DartWorld::~DartWorld() = default;

void DartWorld::build(const Scene& scene) {
  skeleton_ = Skeleton::create("robot");
  skeleton_->setTimeStep(dt_);
  skeleton_->setGravity(scene.gravity);
  for (int i = 0; i < static_cast<int>(robot_->links.size()); ++i) build_link(*robot_, i);
  skeleton_->disableSelfCollisionCheck();
}

// Names are indices: DART prints a warning where one occurs twice.
void DartWorld::build_link(const RobotModel& robot, int index) {
  const RobotLink& link = robot.links[index];
  BodyNode* body = nullptr;
  const BodyNode::Properties body_properties{BodyNode::AspectProperties(fmt::format("l{}", index))};
  if (index == 0) {
    FreeJoint::Properties properties;
    properties.mName = "base";
    std::tie(base_, body) = skeleton_->createJointAndBodyNodePair<FreeJoint>(nullptr, properties, body_properties);
  } else {
    const RobotJoint& joint = robot.joints[index - 1];
    ImplicitHinge::Properties properties;
    properties.mName = fmt::format("j{}", index - 1);
    properties.mAxis = link.axis;
    properties.mT_ParentBodyToJoint = isometry(link.X_PL);
    properties.mPositionLowerLimits[0] = joint.lower;
    properties.mPositionUpperLimits[0] = joint.upper;
    ImplicitHinge* hinge = nullptr;
    std::tie(hinge, body) =
        skeleton_->createJointAndBodyNodePair<ImplicitHinge>(bodies_[link.parent], properties, body_properties);
    hinge->setActuatorType(Joint::FORCE);
    hinges_.push_back(hinge);
  }
  body->setInertia(dart::dynamics::Inertia(link.mass, link.com, link.inertia));
  bodies_.push_back(body);
}

void DartWorld::write_state(const RobotState& state) {
  skeleton_->clearConstraintImpulses();
  skeleton_->clearExternalForces();
  skeleton_->resetAccelerations();
  const Eigen::Isometry3d X_WB = isometry(state.X_WB);
  base_->setPositionsStatic(FreeJoint::convertToPositions(X_WB));
  Eigen::Vector6d V;
  V << state.w_WB_B, X_WB.linear().transpose() * state.v_WB;
  base_->setVelocitiesStatic(V);
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    hinges_[i]->setPosition(0, state.q[static_cast<Eigen::Index>(i)]);
    hinges_[i]->setVelocity(0, state.v[static_cast<Eigen::Index>(i)]);
  }
}

void DartWorld::kick(const Eigen::Vector3d& dv_W) {
  Eigen::Vector6d V = base_->getVelocitiesStatic();
  V.tail<3>() += bodies_[0]->getWorldTransform().linear().transpose() * dv_W;
  base_->setVelocitiesStatic(V);
}

void DartWorld::read_state(RobotState& state) const {
  const Eigen::Isometry3d& X_WB = bodies_[0]->getWorldTransform();
  const Eigen::Vector6d& V = base_->getVelocitiesStatic();
  state.X_WB.p = X_WB.translation();
  state.X_WB.R = Eigen::Quaterniond(X_WB.linear()).normalized();
  state.v_WB = X_WB.linear() * V.tail<3>();
  state.w_WB_B = V.head<3>();
  for (std::size_t i = 0; i < hinges_.size(); ++i) {
    state.q[static_cast<Eigen::Index>(i)] = hinges_[i]->getPositionsStatic()[0];
    state.v[static_cast<Eigen::Index>(i)] = hinges_[i]->getVelocitiesStatic()[0];
  }
}

void DartWorld::append_to(std::vector<double>& values) const {
  const Eigen::VectorXd q = skeleton_->getPositions(), v = skeleton_->getVelocities();
  values.insert(values.end(), q.data(), q.data() + q.size());
  values.insert(values.end(), v.data(), v.data() + v.size());
}

void DartWorld::read_from(std::span<const double> values) {
  const auto n = static_cast<Eigen::Index>(skeleton_->getNumDofs());
  skeleton_->clearConstraintImpulses();
  skeleton_->clearExternalForces();
  skeleton_->resetAccelerations();
  skeleton_->setPositions(Eigen::Map<const Eigen::VectorXd>(values.data(), n));
  skeleton_->setVelocities(Eigen::Map<const Eigen::VectorXd>(values.data() + n, n));
}

void DartWorld::read_poses(std::vector<Eigen::Matrix3d>& R_WL, std::vector<Eigen::Vector3d>& p_WL) const {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Eigen::Isometry3d& X_WL = bodies_[i]->getWorldTransform();
    R_WL[i] = X_WL.linear();
    p_WL[i] = X_WL.translation();
  }
}

void DartWorld::apply(const ExternalForces& pushes) {
  skeleton_->clearExternalForces();
  for (std::size_t link = 0; link < bodies_.size(); ++link) {
    const ExternalForces::Push& push = pushes.all()[link];
    if (push.f_W != Eigen::Vector3d::Zero()) bodies_[link]->addExtForce(push.f_W, push.p_L);
  }
}

bool DartWorld::step(const JointCommand& command, const RobotState& state, std::span<const ContactPoint> points) {
  const Eigen::Vector6d V = base_->getVelocitiesStatic();
  solver_->clear_failure();
  rows_->set(points);
  set_law(command, state);
  if (!forces_are_sensible() || !positions_are_sensible(state) || !velocities_are_sensible()) return false;
  skeleton_->computeForwardDynamics();
  if (!move()) return false;
  if (saturate()) {  // with what contacts and stops did: once more from the begin
    base_->setVelocitiesStatic(V);
    for (std::size_t i = 0; i < hinges_.size(); ++i) hinges_[i]->setVelocity(0, state.v[static_cast<Eigen::Index>(i)]);
    skeleton_->computeForwardDynamics();
    if (!move()) return false;
  }
  find_torques();
  skeleton_->integratePositions(dt_);
  return true;
}

void DartWorld::set_law(const JointCommand& command, const RobotState& state) {
  for (std::size_t i = 0; i < law_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    const double kp = command.kp[j], kd = command.kd[j];
    law_[i].implicit_inertia = dt_ * kd + dt_ * dt_ * kp;
    law_[i].drive = kp * (command.q_target[j] - state.q[j] - dt_ * state.v[j]) - kd * state.v[j] + command.tau_ff[j];
  }
  use_law();
}

void DartWorld::use_law() {
  for (std::size_t i = 0; i < law_.size(); ++i) {
    hinges_[i]->set_added_inertia(robot_->joints[i].armature + law_[i].implicit_inertia);
    hinges_[i]->setForce(0, law_[i].drive);
  }
  skeleton_->dirtyArticulatedInertia(0);
}

// Does what simulation::World::step does with the velocities once the accelerations are known.
bool DartWorld::move() {
  skeleton_->integrateVelocities(dt_);
  if (!velocities_are_sensible()) return false;
  limit_joints();
  rows_->set_stops(stops_);
  solver_->solve();
  if (skeleton_->isImpulseApplied()) {
    skeleton_->computeImpulseForwardDynamics();
    skeleton_->setImpulseApplied(false);
  }
  return !solver_->failed() && velocities_are_sensible();
}

bool DartWorld::forces_are_sensible() const {
  return std::all_of(law_.begin(), law_.end(), [](const Law& law) { return std::abs(law.drive) < kStrongest; }) &&
         std::all_of(bodies_.begin(), bodies_.end(),
                     [](const BodyNode* body) { return body->getExternalForceLocal().cwiseAbs().sum() < kStrongest; });
}

bool DartWorld::velocities_are_sensible() const {
  const auto sensible = [](double speed) { return std::abs(speed) < kDivergedSpeed; };  // false for NaN
  const Eigen::Vector6d& V = base_->getVelocitiesStatic();
  return std::all_of(V.data(), V.data() + V.size(), sensible) &&
         std::all_of(hinges_.begin(), hinges_.end(),
                     [&](const ImplicitHinge* hinge) { return sensible(hinge->getVelocitiesStatic()[0]); });
}

// DART makes a constraint for every joint whose limits are enforced and then looks whether the step would pass them;
// the limits of the others are not enforced in this step.
void DartWorld::limit_joints() {
  stops_.clear();
  for (int i = 0; i < static_cast<int>(hinges_.size()); ++i) {
    const RobotJoint& joint = robot_->joints[i];
    const double q = hinges_[i]->getPositionsStatic()[0], next = q + dt_ * hinges_[i]->getVelocitiesStatic()[0];
    const bool limited = std::min(q, next) < joint.lower || std::max(q, next) > joint.upper;
    hinges_[i]->setLimitEnforcement(limited);
    if (limited) stops_.push_back(i);
  }
}

// Where the law's torque passes its limit with the accelerations that were found, the limit becomes the drive. True
// where that changed anything.
bool DartWorld::saturate() {
  bool changed = false;
  find_torques();
  for (std::size_t i = 0; i < law_.size(); ++i) {
    const double effort = robot_->joints[i].effort;
    if (std::abs(law_[i].torque) <= effort) continue;
    law_[i].drive = std::copysign(effort, law_[i].torque);
    law_[i].implicit_inertia = 0.0;
    changed = true;
  }
  if (changed) use_law();
  return changed;
}

void DartWorld::find_torques() {
  for (std::size_t i = 0; i < law_.size(); ++i)
    law_[i].torque = law_[i].drive - law_[i].implicit_inertia * hinges_[i]->getAccelerationsStatic()[0];
}

Eigen::Vector3d DartWorld::contact_force(std::size_t index) const { return rows_->force(index); }

void DartWorld::read_torques(Eigen::VectorXd& torques) const {
  for (std::size_t i = 0; i < law_.size(); ++i) torques[static_cast<Eigen::Index>(i)] = law_[i].torque;
}

}  // namespace duet
