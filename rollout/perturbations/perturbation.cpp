#include "duet/rollout/perturbations/perturbation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace duet {

Perturbation with_links(Perturbation perturbation, const RobotModel& robot) {
  for (std::shared_ptr<const RobotPerturbation>& one : perturbation.robot)
    if (std::shared_ptr<const RobotPerturbation> named = one->with_links(robot)) one = std::move(named);
  return perturbation;
}

void check_perturbation(const Perturbation& perturbation, const RobotModel& robot) {
  try {
    for (const std::shared_ptr<const RobotPerturbation>& one : perturbation.robot) one->check(robot);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(
        fmt::format("perturbation '{}' on robot '{}': {}", perturbation.name, robot.name, error.what()));
  }
}

std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot) {
  std::shared_ptr<const RobotModel> changed = robot;
  for (const std::shared_ptr<const RobotPerturbation>& one : perturbation.robot) changed = one->changed(changed);
  return changed;
}

int perturbed_link(const std::string& name, const RobotModel& robot) {
  return robot.frames[robot.frame_index(named_link(name, robot))].link;
}

std::string named_link(const std::string& name, const RobotModel& robot) {
  if (name.empty()) return robot.frames[robot.roles.push_frame].name;
  if (std::ranges::find(robot.frames, name, &RobotFrame::name) != robot.frames.end()) return name;
  const auto track = robot.tracks.find(name);
  return track == robot.tracks.end() ? name : robot.frames[track->second].name;
}

Disturbance::Disturbance(const Perturbation& perturbation, const RobotModel& robot, const RobotState& start,
                         int steps_per_act, int acts_per_tick, double dt, std::uint64_t seed)
    : past_(perturbation.delay_ticks * acts_per_tick + 1, start),
      seen_(start),
      steps_per_act_(steps_per_act),
      late_steps_(static_cast<int>(std::lround(perturbation.latency_ms / 1000.0 / dt))),
      commands_((late_steps_ + steps_per_act - 1) / steps_per_act + 1, robot.default_command(start.q)) {
  for (const std::shared_ptr<const RobotPerturbation>& one : perturbation.robot)
    if (std::unique_ptr<RobotAct> begun = one->begin(robot, seed)) acts_.push_back(std::move(begun));
  view_changes_ = std::ranges::any_of(acts_, [](const auto& one) { return one->changes_the_view(); });
}

const RobotState& Disturbance::seen(const RobotState& state) {
  if (past_.size() == 1 && !view_changes_) return state;
  newest_ = (newest_ + 1) % past_.size();
  past_[newest_] = state;
  seen_ = past_[(newest_ + 1) % past_.size()];  // the oldest
  for (const std::unique_ptr<RobotAct>& one : acts_) one->see(seen_);
  return seen_;
}

void Disturbance::send(const JointCommand& command) {
  latest_ = (latest_ + 1) % commands_.size();
  commands_[latest_] = command;
}

// The command sent `age` acts ago began to act late_steps_ steps after it was sent.
const JointCommand& Disturbance::in_effect(int step) const {
  const int age = step >= late_steps_ ? 0 : (late_steps_ - step + steps_per_act_ - 1) / steps_per_act_;
  return commands_[(latest_ + commands_.size() - static_cast<std::size_t>(age)) % commands_.size()];
}

void Disturbance::act(int tick, Backend& backend) {
  for (const std::unique_ptr<RobotAct>& one : acts_) one->act(tick, backend);
}

}  // namespace duet
