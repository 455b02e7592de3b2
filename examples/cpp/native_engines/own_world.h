// The modules share this: the torque law as torques and as rows for an engine's solver, which links may touch, and the
// form in which contacts are reported. Scenes, contact rows and solvers are each engine's own.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"

namespace own {

// The row of a joint's law in an engine's solver (OwnWorld::law_row).
struct LawRow {
  double target = 0.0, inertia = 0.0;  // [rad/s], [kg m^2]
};

class OwnWorld : public duet::PhysicsBackend {
 protected:
  // `law_step`: at which the law is asked, where that is not once a step [s].
  explicit OwnWorld(const duet::Scene& scene) : OwnWorld(scene, scene.dt) {}
  OwnWorld(const duet::Scene& scene, double law_step)
      : PhysicsBackend(scene),
        law_(at_step(scene, law_step)),
        links_(static_cast<int>(scene.robot->links.size())),
        touching_(links_ * links_, 0),
        applied_(Eigen::VectorXd::Zero(scene.robot->dof())),
        v_before_(Eigen::VectorXd::Zero(scene.robot->dof())),
        of_contacts_(Eigen::VectorXd::Zero(6 + scene.robot->dof())),
        Q_(Eigen::VectorXd::Zero(6 + scene.robot->dof())),
        J_(Eigen::MatrixXd::Zero(3, 6 + scene.robot->dof())) {
    if (!scene.self_collision) return;
    for (const auto& [a, b] : scene.robot->self_collision) {
      const int i = scene.robot->shapes[a].link, j = scene.robot->shapes[b].link;
      touching_[i * links_ + j] = kFirst;
      touching_[j * links_ + i] = kSecond;
    }
  }

  [[nodiscard]] const duet::RobotModel& robot() const { return *scene().robot; }
  [[nodiscard]] int links() const { return links_; }
  [[nodiscard]] bool may_touch(int a, int b) const { return touching_[a * links_ + b] != 0; }

  // Motor torques into torques_, and into applied_ those under which a world that knows no armature reaches the law's
  // acceleration if contact forces stay what they were in the step before. False where the state has diverged.
  [[nodiscard]] bool find_torques(const duet::JointCommand& command) {
    v_before_ = state_.v;
    if (!law_.begin(state_, command)) return false;
    return solve_law();
  }
  // The contacts of this step change that by a row of the engine's solver for each joint: at the end of the step
  // v + impulse / inertia = target, with the impulse [N m s] on the joint. The motor's limit holds in applied_, so
  // that a blow can pass it for one step. `inertia` is 0 [kg m^2] where law and robot have none: no row.
  [[nodiscard]] LawRow law_row(int i) const {
    return {v_before_[i] + scene().dt * law_.acceleration()[6 + i], law_.inertia()[i]};
  }
  // Motor torques of the step that was, from state_.v: with what the rows gave.
  void correct_torques() {
    Q_ = law_.acceleration();
    Q_.tail(v_before_.size()) = (state_.v - v_before_) / scene().dt;
    law_.torques(Q_, torques_);
  }
  // The same inside a step, where contacts_ are those of `state`.
  [[nodiscard]] bool find_torques(const duet::RobotState& state, const duet::JointCommand& command) {
    if (!law_.begin(state, command)) return false;
    end_contacts();
    return solve_law();
  }
  [[nodiscard]] const Eigen::VectorXd& applied() const { return applied_; }

  // `f_W` acts on link i; j is another link, or -1 for the ground or the capsule `capsule` of the partner (-1: none).
  // Where both are links, the one that the declared pair names first is reported as touched.
  void report(int i, int j, int capsule, const Eigen::Vector3d& p_W, const Eigen::Vector3d& f_W, double depth) {
    if (contacts_.size() == narrow_phase_.capacity())
      throw std::runtime_error(std::string(name()) + ": more than " + std::to_string(contacts_.size()) +
                               " contacts in one step");
    duet::Contact contact{.link = i, .other = capsule, .p_WC = p_W, .f_W = f_W, .depth = std::max(0.0, depth)};
    if (capsule >= 0) contact.side = duet::ContactSide::kHuman;
    if (j >= 0) {
      contact.side = duet::ContactSide::kRobot;
      contact.other = j;
      if (touching_[i * links_ + j] == kSecond) {
        std::swap(contact.link, contact.other);
        contact.f_W = -contact.f_W;
      }
    }
    contacts_.push_back(contact);
  }
  // After the last report of a step: an order that no cache and no address decides, and what the next step's law is
  // told.
  void end_contacts() {
    std::stable_sort(contacts_.begin(), contacts_.end(), [](const duet::Contact& a, const duet::Contact& b) {
      return std::tuple(a.side, a.link, a.other, a.p_WC.x(), a.p_WC.y()) <
             std::tuple(b.side, b.link, b.other, b.p_WC.x(), b.p_WC.y());
    });
    Q_.setZero();
    for (const duet::Contact& contact : contacts_) {
      add_force(contact.link, contact.p_WC, contact.f_W);
      if (contact.side == duet::ContactSide::kRobot) add_force(contact.other, contact.p_WC, -contact.f_W);
    }
    of_contacts_ = Q_;
  }
  void forget_contacts() { of_contacts_.setZero(); }
  // The same for a snapshot: 6 + dof numbers.
  void append_contacts(std::vector<double>& values) const {
    values.insert(values.end(), of_contacts_.data(), of_contacts_.data() + of_contacts_.size());
  }
  std::span<const double> read_contacts_from(std::span<const double> values) {
    std::copy_n(values.data(), of_contacts_.size(), of_contacts_.data());
    return values.subspan(of_contacts_.size());
  }

 private:
  static duet::Scene at_step(duet::Scene scene, double step) {
    scene.dt = step;
    return scene;
  }
  bool solve_law() {
    Q_ = of_contacts_;
    for (int link = 0; link < links_; ++link) {
      const duet::ExternalForces::Push& push = pushes_.all()[link];
      if (!push.f_W.isZero(0.0)) add_force(link, law_.kinematics().X_WL(link) * push.p_L, push.f_W);
    }
    law_.solve(Q_);
    law_.equivalent_torques(law_.acceleration(), applied_);
    law_.torques(law_.acceleration(), torques_);
    return applied_.allFinite();
  }
  void add_force(int link, const Eigen::Vector3d& p_W, const Eigen::Vector3d& f_W) {
    law_.kinematics().point_jacobian(link, p_W, J_);
    Q_.noalias() += J_.transpose() * f_W;
  }

  static constexpr char kFirst = 1, kSecond = 2;  // of a declared pair; 0: may not touch

  duet::ImplicitLaw law_;
  int links_;
  std::vector<char> touching_;
  Eigen::VectorXd applied_, v_before_, of_contacts_, Q_;
  Eigen::MatrixXd J_;
};

// The least code that makes an engine's calls is its own world's step.
template <typename World>
double bare_step_seconds(const duet::Scene& scene, const duet::RobotState& state, const duet::JointCommand& command,
                         int steps) {
  if (steps < 1) throw std::invalid_argument("steps is " + std::to_string(steps) + ", expected >= 1");
  World world(scene);
  world.reset(state);
  const double begin = duet::thread_cpu_seconds();
  for (int i = 0; i < steps; ++i) world.step(command);
  return duet::thread_cpu_seconds() - begin;
}

}  // namespace own
