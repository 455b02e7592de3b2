#include "duet/rollout/audit/trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "duet/backends/engine_module.h"
#include "duet/rollout/world.h"

namespace duet {
namespace {

constexpr double kSlowerShare = 0.8;  // of the forward speed, where a reading is confirmed
constexpr double kFallenShare = 0.4;  // of the standing height, below which it has fallen
constexpr double kFallenTilt = 0.6;   // cosine of the base's lean, below which it has fallen

// A velocity that is told in one direction: `wanted` or half of what it takes, clearly above what is answered by steps.
double told_within(const CommandRange& range, double wanted) {
  return std::min(std::max({wanted, 1.5 * range.steps_from, 0.5 * range.upper}), range.upper);
}

}  // namespace

std::string TrialTask::command() const { return fmt::format("{},{},{}", told.x(), told.y(), told.z()); }

std::vector<TrialTask> trial_tasks(const Descriptor& descriptor) {
  std::vector<TrialTask> tasks = {{.name = "stand", .told = {0, 0, 0}, .seconds = 2.5}};
  if (!descriptor.command) return tasks;
  const VelocityInterface& command = *descriptor.command;
  tasks.push_back({.name = "forward", .told = {told_within(command.forward, 0.5), 0, 0}, .seconds = 3.0});
  tasks.push_back({.name = "lateral", .told = {0, told_within(command.lateral, 0.3), 0}, .seconds = 3.0});
  tasks.push_back({.name = "turn", .told = {0, 0, told_within(command.yaw, 0.5)}, .seconds = 3.0});
  return tasks;
}

std::vector<TrialTask> confirming_tasks(const Descriptor& descriptor) {
  std::vector<TrialTask> tasks = trial_tasks(descriptor);
  for (TrialTask& task : tasks) {
    task.told = {kSlowerShare * task.told.x(), -task.told.y(), -task.told.z()};
    if (descriptor.command) {
      task.told.y() = std::max(task.told.y(), descriptor.command->lateral.lower);
      task.told.z() = std::max(task.told.z(), descriptor.command->yaw.lower);
    }
    task.seconds += 1.0;
  }
  return tasks;
}

namespace {

// Whether acts begin at a physics step, also at the 100 Hz of another reading.
bool fits(double dt, const Descriptor& descriptor) {
  const auto divides = [&](double period) {
    const double steps = period / dt;
    return steps > 0.5 && std::abs(steps - std::round(steps)) < 1e-6;
  };
  return divides(kTick / 2.0) && divides(kTick / descriptor.acts_per_tick());
}

}  // namespace

TrialPhysics trial_physics(const Descriptor& descriptor, const Metadata& metadata, const RobotModel& robot) {
  TrialPhysics physics{.height = robot.standing_height};
  const OwnPhysics own = descriptor.own_physics.value_or(OwnPhysics{});
  if (own.height) {
    physics.height = *own.height;
    physics.height_from = "its descriptor";
  }
  const std::optional<double> dt = own.dt ? own.dt : physics_step_of(metadata);
  if (!dt) return physics;
  const std::string from = own.dt ? "its descriptor" : "its network's file";
  if (!fits(*dt, descriptor)) {
    physics.dt_from = fmt::format("of the profile parity: the {:g} ms of {} do not divide its ticks", 1e3 * *dt, from);
    return physics;
  }
  physics.dt = *dt;
  physics.dt_from = fmt::format("as {} says", from);
  return physics;
}

TrialGround::TrialGround(const std::string& engine, std::shared_ptr<const RobotModel> robot, double dt)
    : robot_(std::move(robot)) {
  Scene scene;
  if (dt > 0.0) scene.dt = dt;
  scene.robot = robot_;
  scene.partner = PartnerMode::kNone;
  backend_ = make_backend(engine, scene);
}

namespace {

// Sums over a trial's ticks.
class TrialSums {
 public:
  explicit TrialSums(const RobotModel& robot) : robot_(robot) {}

  void add_targets(const Eigen::VectorXd& targets) {
    if (ticks_ >= 2) jerks_ += (targets - 2.0 * last_ + before_).squaredNorm() / robot_.dof();
    before_ = ticks_ == 0 ? targets : last_;
    last_ = targets;
  }
  void add_state(const RobotState& state) {
    const double lean = std::acos(std::clamp((state.X_WB.R * Eigen::Vector3d::UnitZ()).z(), -1.0, 1.0));
    tilts_ += lean * lean;
    speeds_ += state.v.squaredNorm() / robot_.dof();
    if (ticks_ * kTick < kTrialSettling) return;
    const Eigen::Vector3d v = yaw_rotation(-yaw_of(state.X_WB.R)) * state.v_WB;
    went_ += Eigen::Vector3d(v.x(), v.y(), state.w_WB_B.z());
    heights_ += state.X_WB.p.z();
    ++measured_;
  }
  void add_torques(const Eigen::VectorXd& torques) {
    for (int j = 0; j < robot_.dof(); ++j)
      saturated_ += std::abs(torques[j]) >= 0.99 * robot_.joints[j].effort ? 1.0 / robot_.dof() : 0.0;
    ++ticks_;
  }
  void write(const RobotState& last, const RobotState& start, TrialResult& result) const {
    const double ticks = std::max(ticks_, 1), measured = std::max(measured_, 1);
    result.lasted = ticks_ * kTick;
    result.went = went_ / measured;
    result.height = measured_ > 0 ? heights_ / measured : last.X_WB.p.z();
    result.tilt = std::sqrt(tilts_ / ticks);
    result.jerk = std::sqrt(jerks_ / ticks);
    result.speed = std::sqrt(speeds_ / ticks);
    result.saturated = saturated_ / ticks;
    result.drift = (last.X_WB.p - start.X_WB.p).head<2>().norm();
  }

 private:
  const RobotModel& robot_;
  int ticks_ = 0, measured_ = 0;
  Eigen::VectorXd last_, before_;  // targets
  Eigen::Vector3d went_ = Eigen::Vector3d::Zero();
  double jerks_ = 0.0, tilts_ = 0.0, speeds_ = 0.0, saturated_ = 0.0, heights_ = 0.0;
};

}  // namespace

TrialResult TrialGround::run(Controller& controller, const TrialTask& task,
                             const std::map<std::string, double>& posture) {
  RobotState start = robot_->standing_state();
  for (const auto& [name, angle] : posture) start.q[robot_->joint_index(name)] = angle;
  const Reference reference{start.X_WB, start.q};
  backend_->reset(start);
  controller.reset(start);
  TrialResult result;
  TrialSums sums(*robot_);
  JointCommand command;
  const int steps = steps_per_tick(backend_->scene().dt), steps_per_act = steps / controller.acts_per_tick();
  const FallRule rule{kFallenShare * robot_->standing_height, kFallenTilt};
  const auto stands = [&](int) { return !has_fallen(backend_->state(), rule); };
  const auto command_at = [&](int i) -> const JointCommand& {
    if (i > 0 && i % steps_per_act == 0) controller.act(backend_->state(), reference, command);
    return command;
  };
  for (int tick = 0; tick < ticks_of(task.seconds) && result.upright; ++tick) {
    controller.act(backend_->state(), reference, command);
    sums.add_targets(command.q_target);
    sums.add_state(backend_->state());
    result.upright = step_control_period(*backend_, steps, command_at, stands) == Outcome::kOk;
    sums.add_torques(backend_->torques());
  }
  sums.write(backend_->state(), start, result);
  return result;
}

double trial_cost(const TrialTask& task, const TrialResult& result) {
  if (!result.upright) return 2.0 - result.lasted / task.seconds;
  const double plane = (result.went - task.told).head<2>().norm() / 0.5;
  const double yaw = std::abs(result.went.z() - task.told.z()) / 0.5;
  const double sum = 0.5 * std::min(plane, 1.0) + 0.5 * std::min(yaw, 1.0) + 0.5 * std::min(result.tilt / 0.5, 1.0) +
                     0.3 * std::min(result.jerk / 0.3, 1.0) + 0.5 * std::min(result.saturated / 0.3, 1.0);
  return std::min(sum, 1.0);
}

}  // namespace duet
