#include "duet/rollout/disturbance.h"

#include <cmath>
#include <numbers>

#include "duet/core/clock.h"

namespace duet {
namespace {

int ticks_for(double seconds) { return std::max(1, ticks_of(seconds)); }

}  // namespace

Disturbance::Disturbance(const Perturbation& perturbation, const RobotModel& robot, const RobotState& start,
                         int steps_per_tick, double dt, std::uint64_t seed)
    : perturbation_(perturbation),
      robot_(robot),
      noise_(seed, stream_key({"perturbation", "noise"})),
      direction_(seed, stream_key({"perturbation", "push"})),
      kick_(seed, stream_key({"perturbation", "kick"})),
      past_(perturbation.delay_ticks + 1, start),
      seen_(start),
      steps_per_tick_(steps_per_tick),
      late_steps_(static_cast<int>(std::lround(perturbation.latency_ms / 1000.0 / dt))),
      commands_((late_steps_ + steps_per_tick - 1) / steps_per_tick + 1, robot.default_command(start.q)),
      kinematics_(robot) {
  if (perturbation_.kick) next_kick_ = ticks_of(perturbation_.kick->first);
  if (!perturbation_.push) return;
  link_ = perturbed_link(perturbation_.push->link, robot);
  push_ticks_ = ticks_for(perturbation_.push->duration);
  every_ticks_ = ticks_for(perturbation_.push->every);
}

const RobotState& Disturbance::seen(const RobotState& state) {
  if (past_.size() == 1 && !perturbation_.noise) return state;
  newest_ = (newest_ + 1) % past_.size();
  past_[newest_] = state;
  seen_ = past_[(newest_ + 1) % past_.size()];  // the oldest
  if (perturbation_.noise) add_noise(seen_);
  return seen_;
}

void Disturbance::add_noise(RobotState& state) {
  const StateNoise& deviation = *perturbation_.noise;
  for (double& q : state.q) q += deviation.q * noise_.normal();
  for (double& v : state.v) v += deviation.v * noise_.normal();
  for (double& w : state.w_WB_B) w += deviation.w * noise_.normal();
  const double x = deviation.gravity * noise_.normal(), y = deviation.gravity * noise_.normal();
  const double angle = std::hypot(x, y);
  if (angle > 0.0) state.X_WB.R *= Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(x, y, 0.0) / angle));
}

void Disturbance::send(const JointCommand& command) {
  latest_ = (latest_ + 1) % commands_.size();
  commands_[latest_] = command;
}

// The command sent `age` ticks ago began to act late_steps_ steps after its tick did.
const JointCommand& Disturbance::in_effect(int step) const {
  const int age = step >= late_steps_ ? 0 : (late_steps_ - step + steps_per_tick_ - 1) / steps_per_tick_;
  return commands_[(latest_ + commands_.size() - static_cast<std::size_t>(age)) % commands_.size()];
}

void Disturbance::kick(int tick, Backend& backend) {
  const KickPlan& plan = *perturbation_.kick;
  if (tick < next_kick_) return;
  const double angle = 2.0 * std::numbers::pi * kick_.uniform();
  backend.kick(plan.speed * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0));
  next_kick_ = tick + ticks_for(kick_.uniform(plan.from, plan.to));
}

void Disturbance::push(int tick, Backend& backend) {
  if (perturbation_.kick) kick(tick, backend);
  if (link_ < 0) return;
  const int phase = (tick + every_ticks_ - every_ticks_ / 2) % every_ticks_;
  const bool begins = tick >= every_ticks_ / 2 && phase == 0;
  if (!begins && !(pushing_ && phase == push_ticks_)) return;
  const RobotState& state = backend.state();
  kinematics_.update(state.X_WB, state.q);
  const Eigen::Vector3d p_W = kinematics_.p_WL(link_) + kinematics_.R_WL(link_) * robot_.links[link_].com;
  const double angle = begins ? 2.0 * std::numbers::pi * direction_.uniform() : 0.0;
  const double force = begins ? perturbation_.push->force : 0.0;
  backend.push(link_, force * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0), p_W);
  pushing_ = begins;
}

}  // namespace duet
