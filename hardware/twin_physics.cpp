#include "duet/hardware/twin_physics.h"

#include <algorithm>

#include "duet/backends/factory.h"
#include "duet/robots/dynamics.h"

namespace duet {
namespace {

// The rope: it carries the G1's 35 kg with 3 cm of give, and a robot that swings comes to rest in about a second.
constexpr double kRopeStiffness = 10000.0;  // upward [N/m]
constexpr double kRopeDamping = 600.0;      // [N s/m]
constexpr double kSwayStiffness = 1000.0;   // level: of a frame that keeps it over its place [N/m]
constexpr double kSwayDamping = 200.0;      // [N s/m]
constexpr double kHookHeight = 0.25;        // over the origin of the trunk, where its eye bolts are [m]

Scene scene_of(const std::shared_ptr<const RobotModel>& robot, double dt) {
  Scene scene;
  scene.robot = robot;
  scene.partner = PartnerMode::kNone;
  scene.dt = dt;
  return scene;
}

}  // namespace

TwinPhysics::TwinPhysics(const std::string& engine, std::shared_ptr<const RobotModel> robot, double dt)
    : robot_(std::move(robot)),
      backend_(make_backend(engine, scene_of(robot_, dt))),
      kinematics_(*robot_),
      command_(robot_->default_command(robot_->neutral)),
      jacobian_(3, 6 + robot_->dof()),
      hook_(robot_->frames[robot_->roles.push_frame].link),
      v_before_(Eigen::Vector3d::Zero()) {
  backend_->reset(robot_->standing_state());
  hanging_ = 0.0;
  hang(1.0);
}

void TwinPhysics::hang(double share) {
  if (hanging_ == 0.0 && share > 0.0) {
    kinematics_.update(state().X_WB, state().q);
    anchor_W_ = kinematics_.p_WL(hook_) + kinematics_.R_WL(hook_) * Eigen::Vector3d(0.0, 0.0, kHookHeight);
  }
  hanging_ = std::clamp(share, 0.0, 1.0);
}

// A rope pulls and does not push: upward where the hook is below its place, level towards it.
void TwinPhysics::pull() {
  kinematics_.update(state().X_WB, state().q);
  const Eigen::Vector3d hook_W =
      kinematics_.p_WL(hook_) + kinematics_.R_WL(hook_) * Eigen::Vector3d(0.0, 0.0, kHookHeight);
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  if (hanging_ > 0.0) {
    kinematics_.point_jacobian(hook_, hook_W, jacobian_);
    const RobotState& now = state();
    const Eigen::Vector3d v_W = jacobian_.leftCols<3>() * now.v_WB + jacobian_.middleCols<3>(3) * now.w_WB_B +
                                jacobian_.rightCols(robot_->dof()) * now.v;
    const Eigen::Vector3d off = anchor_W_ - hook_W;
    force = kSwayStiffness * off - kSwayDamping * v_W;
    force.z() = off.z() > 0.0 ? std::max(kRopeStiffness * off.z() - kRopeDamping * v_W.z(), 0.0) : 0.0;
  }
  backend_->push(hook_, hanging_ * force, hook_W);
}

void TwinPhysics::step(const LowCommandFrame& command) {
  if (diverged_) return;
  for (int j = 0; j < kG1Motors; ++j) {
    const MotorCommandFrame& motor = command.motor[j];
    const double enabled = motor.mode == 1 ? 1.0 : 0.0;
    command_.q_target[j] = motor.q;
    command_.kp[j] = enabled * motor.kp;
    command_.kd[j] = enabled * motor.kd;
    command_.tau_ff[j] = enabled * (motor.tau + motor.kd * motor.dq);
  }
  v_before_ = state().v_WB;
  pull();
  diverged_ = backend_->step(command_) != Outcome::kOk;
}

Eigen::Vector3d TwinPhysics::specific_force() const {
  const Eigen::Vector3d a_W = (state().v_WB - v_before_) / dt();
  return state().X_WB.R.conjugate() * (a_W + Eigen::Vector3d(0.0, 0.0, kGravity));
}

}  // namespace duet
