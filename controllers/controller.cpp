#include "duet/controllers/controller.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

bool is_finite(const Pose& pose) { return pose.R.coeffs().allFinite() && pose.p.allFinite(); }

bool is_finite(const RobotState& state) {
  return is_finite(state.X_WB) && state.v_WB.allFinite() && state.w_WB_B.allFinite() && state.q.allFinite() &&
         state.v.allFinite();
}

bool is_finite(const Reference& reference) { return is_finite(reference.X_WB) && reference.q.allFinite(); }

bool is_finite(const JointCommand& command) {
  return command.q_target.allFinite() && command.kp.allFinite() && command.kd.allFinite() && command.tau_ff.allFinite();
}

class Guard final : public Controller {
 public:
  Guard(std::unique_ptr<Controller> controller, const std::shared_ptr<const RobotModel>& robot)
      : controller_(std::move(controller)),
        acts_per_tick_(controller_->acts_per_tick()),
        card_(robot->default_command(robot->neutral)),
        held_(card_) {}

  [[nodiscard]] std::string_view name() const override { return controller_->name(); }
  [[nodiscard]] int acts_per_tick() const override { return acts_per_tick_; }
  [[nodiscard]] ControllerFaults faults() const override { return faults_; }

  void reset(const RobotState& state) override {
    check_size("state", state.q);
    require(is_finite(state), "reset: expected a finite state of the robot, found a value that is not");
    held_ = card_;
    held_.q_target = state.q;
    measured_ = state.q;
    faults_ = {};
    bad_in_a_row_ = 0;
    stop_ticks_ = 0;
    controller_->reset(state);
  }

  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    check_size("state", state.q);
    check_size("reference", reference.q);
    if (state.q.allFinite()) measured_ = state.q;
    const bool good = !faults_.stopped && ask(state, reference, command);
    if (good) {
      bad_in_a_row_ = 0;
      held_ = command;
      return;
    }
    if (!faults_.stopped && ++bad_in_a_row_ > kGuardHeldTicks * acts_per_tick_) begin_stop();
    if (faults_.stopped) ramp_down();
    command = held_;
  }

 private:
  // Whether the controller's command can be used.
  bool ask(const RobotState& state, const Reference& reference, JointCommand& command) {
    if (!is_finite(state) || !is_finite(reference)) {
      ++faults_.observations;
      return false;
    }
    controller_->act(state, reference, command);
    if (is_finite(command)) return true;
    ++faults_.actions;
    return false;
  }

  void begin_stop() {
    faults_.stopped = true;
    held_.q_target = measured_;
    held_.kd = card_.kd;
    held_.tau_ff.setZero();
  }

  void ramp_down() {
    const int ramp = kGuardRampTicks * acts_per_tick_;
    const double share = 1.0 - static_cast<double>(stop_ticks_) / ramp;
    held_.kp = std::max(share, 0.0) * card_.kp;
    stop_ticks_ = std::min(stop_ticks_ + 1, ramp);
  }

  void check_size(const char* what, const Eigen::VectorXd& q) const {
    if (q.size() == card_.kp.size()) return;
    throw std::invalid_argument(
        fmt::format("controller '{}': expected a {} of {} joints, found {}", name(), what, card_.kp.size(), q.size()));
  }

  std::unique_ptr<Controller> controller_;
  int acts_per_tick_;
  JointCommand card_;  // the card's gains
  JointCommand held_;  // what stands while nothing better is known
  Eigen::VectorXd measured_;
  ControllerFaults faults_;
  int bad_in_a_row_ = 0;
  int stop_ticks_ = 0;
};

class DampedAtMost final : public Controller {
 public:
  DampedAtMost(std::unique_ptr<Controller> controller, Eigen::VectorXd most)
      : controller_(std::move(controller)), most_(std::move(most)) {}

  [[nodiscard]] std::string_view name() const override { return controller_->name(); }
  [[nodiscard]] int acts_per_tick() const override { return controller_->acts_per_tick(); }
  [[nodiscard]] ControllerFaults faults() const override { return controller_->faults(); }
  void reset(const RobotState& state) override { controller_->reset(state); }
  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    controller_->act(state, reference, command);
    command.kd = command.kd.cwiseMin(most_);
  }

 private:
  std::unique_ptr<Controller> controller_;
  Eigen::VectorXd most_;
};

}  // namespace

std::unique_ptr<Controller> make_damped_at_most(std::unique_ptr<Controller> controller, Eigen::VectorXd most) {
  return std::make_unique<DampedAtMost>(std::move(controller), std::move(most));
}

std::unique_ptr<Controller> make_guarded(std::unique_ptr<Controller> controller,
                                         const std::shared_ptr<const RobotModel>& robot) {
  require(controller != nullptr && robot != nullptr, "make_guarded: expected a controller and a robot, found none");
  return std::make_unique<Guard>(std::move(controller), robot);
}

namespace {

class Pd final : public Controller {
 public:
  explicit Pd(const std::shared_ptr<const RobotModel>& robot) : gains_(robot->default_command(robot->neutral)) {}

  [[nodiscard]] std::string_view name() const override { return "pd"; }
  void reset(const RobotState&) override {}

  void act(const RobotState&, const Reference& reference, JointCommand& command) override {
    command.q_target = reference.q;
    command.kp = gains_.kp;
    command.kd = gains_.kd;
    command.tau_ff = gains_.tau_ff;
  }

 private:
  JointCommand gains_;
};

}  // namespace

std::unique_ptr<Controller> make_pd_controller(
    std::shared_ptr<const RobotModel> robot) {  // NOLINT(performance-unnecessary-value-param): as all makers
  return std::make_unique<Pd>(robot);
}

}  // namespace duet
