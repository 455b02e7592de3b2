// An engine of one's own: the robot hangs by its pelvis in a gantry, nothing touches it, and each joint follows the
// torque law of duet's JointCommand under the robot's own dynamics. It shows what a controller does to the joints,
// apart from balance.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/robots/dynamics.h"

namespace {

const duet::EngineOption kOptions[] = {
    duet::number_option("friction", 0.0, 0.0, 10.0, "viscous friction of each joint [N m s/rad]")};

class GantryBackend final : public duet::PhysicsBackend {
 public:
  explicit GantryBackend(const duet::Scene& scene)
      : PhysicsBackend(scene),
        dynamics_(*this->scene().robot, scene.gravity),
        friction_(duet::option_number(scene.options, kOptions, "friction")),
        joints_(scene.robot->dof()),
        armature_(joints_),
        effort_(joints_),
        drive_(joints_),
        inertia_(joints_),
        a_(joints_),
        outside_(joints_),
        mass_(joints_, joints_),
        factor_(joints_),
        J_(3, 6 + joints_) {
    for (int j = 0; j < joints_; ++j) {
      armature_[j] = scene.robot->joints[j].armature;
      effort_[j] = scene.robot->joints[j].effort;
    }
  }

  [[nodiscard]] std::string_view name() const override { return "gantry"; }
  [[nodiscard]] std::string version() const override { return "1"; }

 private:
  void place() override { hold_pelvis(); }
  void do_kick(const Eigen::Vector3d&) override {}  // the gantry holds the pelvis

  // M a = u - b + Q with the law u implicit in the step, as duet's own adapters take it (backends/physics_backend.h); a
  // joint whose torque would pass its effort gets just that. Allocates nothing.
  duet::Outcome advance(const duet::JointCommand& command) override {
    const double dt = scene().dt;
    hold_pelvis();
    dynamics_.update(state_);
    find_outside_forces();
    inertia_ = dt * command.kd.array() + dt * dt * command.kp.array();
    drive_ = command.kp.array() * (command.q_target - state_.q - dt * state_.v).array() -
             command.kd.array() * state_.v.array() + command.tau_ff.array();
    accelerate();
    if (saturate()) accelerate();
    torques_ = (drive_ - inertia_ * a_.array()).matrix();
    state_.v += dt * a_;
    state_.q += dt * state_.v;
    stop_at_limits();
    return duet::speeds_are_sane(state_) ? duet::Outcome::kOk : duet::Outcome::kDiverged;
  }

  // Nothing beyond the state.
  void append_to(std::vector<double>&) const override {}
  void read_from(std::span<const double>) override {}

  void hold_pelvis() {
    state_.v_WB.setZero();
    state_.w_WB_B.setZero();
  }

  // Friction, gravity and the like, and what Backend::push asks for.
  void find_outside_forces() {
    outside_ = -dynamics_.bias().tail(joints_) - friction_ * state_.v;
    if (!pushes_.any()) return;
    const duet::Kinematics& kinematics = dynamics_.kinematics();
    for (int link = 0; link < static_cast<int>(pushes_.all().size()); ++link) {
      const duet::ExternalForces::Push& push = pushes_.all()[link];
      kinematics.point_jacobian(link, kinematics.p_WL(link) + kinematics.R_WL(link) * push.p_L, J_);
      outside_.noalias() += J_.rightCols(joints_).transpose() * push.f_W;
    }
  }

  // a_ from drive_ and inertia_; the pelvis does not move.
  void accelerate() {
    mass_ = dynamics_.mass().bottomRightCorner(joints_, joints_);
    mass_.diagonal().array() += armature_ + inertia_ + scene().dt * friction_;
    factor_.compute(mass_);
    a_ = drive_.matrix() + outside_;
    factor_.solveInPlace(a_);
  }

  // True where a torque passed its effort: the law of that joint is then the effort.
  bool saturate() {
    bool any = false;
    for (int j = 0; j < joints_; ++j) {
      const double torque = drive_[j] - inertia_[j] * a_[j];
      if (std::abs(torque) <= effort_[j]) continue;
      drive_[j] = std::copysign(effort_[j], torque);
      inertia_[j] = 0.0;
      any = true;
    }
    return any;
  }

  void stop_at_limits() {
    for (int j = 0; j < joints_; ++j) {
      const duet::RobotJoint& joint = scene().robot->joints[j];
      const double inside = std::clamp(state_.q[j], joint.lower, joint.upper);
      if (inside == state_.q[j]) continue;
      state_.q[j] = inside;
      state_.v[j] = 0.0;
    }
  }

  duet::Dynamics dynamics_;
  double friction_;  // [N m s/rad]
  int joints_;
  Eigen::ArrayXd armature_, effort_, drive_, inertia_;
  Eigen::VectorXd a_, outside_;
  Eigen::MatrixXd mass_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::MatrixXd J_;
};

std::string version() { return "1"; }

std::unique_ptr<duet::Backend> make(const duet::Scene& scene) { return std::make_unique<GantryBackend>(scene); }

// There is no library below this engine: its own steps are the least code that does the same.
double bare_step_seconds(const duet::Scene& scene, const duet::RobotState& state, const duet::JointCommand& command,
                         int steps) {
  if (steps < 1) throw std::invalid_argument("gantry: steps is " + std::to_string(steps) + ", expected >= 1");
  GantryBackend backend(scene);
  backend.reset(state);
  const double begin = duet::thread_cpu_seconds();
  for (int i = 0; i < steps; ++i) backend.step(command);
  return duet::thread_cpu_seconds() - begin;
}

const duet::EngineModule kModule = {.name = "gantry",
                                    .version = version,
                                    .make = make,
                                    .options = kOptions,
                                    .bare_step_seconds = bare_step_seconds,
                                    .no_solid_partner = "nothing touches its robot"};

}  // namespace

DUET_ENGINE_MODULE(kModule)
