#include "duet/controllers/controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "duet/core/machine.h"
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

// A controller whose commands are changed before they go on.
class ChangedCommands : public Controller {
 public:
  explicit ChangedCommands(std::unique_ptr<Controller> controller) : controller_(std::move(controller)) {}

  [[nodiscard]] std::string_view name() const final { return controller_->name(); }
  [[nodiscard]] int acts_per_tick() const final { return controller_->acts_per_tick(); }
  [[nodiscard]] ControllerFaults faults() const final { return controller_->faults(); }
  void reset(const RobotState& state) final { controller_->reset(state); }
  void act(const RobotState& state, const Reference& reference, JointCommand& command) final {
    controller_->act(state, reference, command);
    change(reference, command);
  }

 private:
  virtual void change(const Reference& reference, JointCommand& command) const = 0;

  std::unique_ptr<Controller> controller_;
};

class DampedAtMost final : public ChangedCommands {
 public:
  DampedAtMost(std::unique_ptr<Controller> controller, Eigen::VectorXd most)
      : ChangedCommands(std::move(controller)), most_(std::move(most)) {}

 private:
  void change(const Reference&, JointCommand& command) const override { command.kd = command.kd.cwiseMin(most_); }

  Eigen::VectorXd most_;
};

class ReferenceArms final : public ChangedCommands {
 public:
  ReferenceArms(std::unique_ptr<Controller> controller, std::vector<int> joints)
      : ChangedCommands(std::move(controller)), joints_(std::move(joints)) {}

 private:
  void change(const Reference& reference, JointCommand& command) const override {
    for (const int joint : joints_) command.q_target[joint] = reference.q[joint];
  }

  std::vector<int> joints_;
};

}  // namespace

std::unique_ptr<Controller> make_damped_at_most(std::unique_ptr<Controller> controller, Eigen::VectorXd most) {
  return std::make_unique<DampedAtMost>(std::move(controller), std::move(most));
}

std::unique_ptr<Controller> make_reference_arms(std::unique_ptr<Controller> controller, const RobotModel& robot) {
  std::vector<int> joints;
  for (const std::vector<int>& arm : robot.roles.arms) joints.insert(joints.end(), arm.begin(), arm.end());
  require(!joints.empty(), "controller '{}': option 'arms': expected a robot with arms that move, found '{}'",
          controller->name(), robot.name);
  return std::make_unique<ReferenceArms>(std::move(controller), std::move(joints));
}

std::unique_ptr<Controller> make_guarded(std::unique_ptr<Controller> controller,
                                         const std::shared_ptr<const RobotModel>& robot) {
  require(controller != nullptr && robot != nullptr, "make_guarded: expected a controller and a robot, found none");
  return std::make_unique<Guard>(std::move(controller), robot);
}

namespace {

#ifdef DUET_SANITIZED
constexpr double kLongestTick = 10.0 * kTick;  // [s]; checked code is slower by so much
#else
constexpr double kLongestTick = kTick;  // [s]
#endif

void act_for_a_tick(Controller& controller, const RobotState& state, JointCommand& command) {
  for (int i = 0; i < controller.acts_per_tick(); ++i) controller.act(state, {state.X_WB, state.q}, command);
}

// The quickest first tick after a reset, in which every controller asks its network; the first that is on time will do
// [s].
double quickest_first_tick(Controller& controller, const RobotState& state, JointCommand& command) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kTriedTicks && least > kLongestTick; ++i) {
    controller.reset(state);
    const double begin = thread_computed_seconds();
    act_for_a_tick(controller, state, command);
    least = std::min(least, thread_computed_seconds() - begin);
  }
  return least;
}

}  // namespace

void require_usable(Controller& controller, const RobotModel& robot, const std::string& name) {
  const RobotState state = robot.standing_state();
  JointCommand command = robot.default_command(state.q);
  double quickest = 0.0;
  try {
    quickest = quickest_first_tick(controller, state, command);
    for (int tick = 1; tick < kTriedTicks && quickest <= kLongestTick; ++tick)
      act_for_a_tick(controller, state, command);
  } catch (const std::exception&) {
    return;
  }
  if (controller.faults().actions > 0)
    throw InputError(
        fmt::format("controller '{}': expected finite numbers for the standing pose of '{}', found others: its "
                    "network is broken or is shown what it was not trained with",
                    name, robot.name));
  if (quickest > kLongestTick)
    throw InputError(fmt::format(
        "controller '{}': expected an answer within a tick of {:g} ms, found {:.3g} ms of computing in the quickest of "
        "{} tries: take a smaller network, or one that acts less often in a tick",
        name, 1e3 * kLongestTick, 1e3 * quickest, kTriedTicks));
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
