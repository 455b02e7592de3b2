// A perturbation at work in one episode: between the engine's state and the controller, between the controller's
// command and the joints, and on the robot. Nothing allocates after construction; not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/rollout/perturbations/perturbation.h"

namespace duet {

class Disturbance {
 public:
  // `start` is what the controller sees of the time before the episode, and what the joints hold until the first
  // command arrives. `steps_per_tick` physics steps of `dt` [s] are one control tick.
  Disturbance(const Perturbation& perturbation, const RobotModel& robot, const RobotState& start, int steps_per_tick,
              double dt, std::uint64_t seed);

  // The controller's view at this tick; once per tick. `state` itself without delay and where no act changes it.
  const RobotState& seen(const RobotState& state);
  // The command of this tick; once per tick. Copies.
  void send(const JointCommand& command);
  // The command that is in effect in a physics step of this tick, counted from 0.
  [[nodiscard]] const JointCommand& in_effect(int step) const;
  // Acts on the robot; before the physics steps of `tick`.
  void act(int tick, Backend& backend);

 private:
  std::vector<std::unique_ptr<RobotAct>> acts_;
  bool view_changes_ = false;

  std::vector<RobotState> past_;  // a ring of the last delay_ticks + 1 states
  std::size_t newest_ = 0;
  RobotState seen_;

  int steps_per_tick_;
  int late_steps_;                      // from a command to its effect
  std::vector<JointCommand> commands_;  // a ring of the latest, newest at latest_
  std::size_t latest_ = 0;
};

}  // namespace duet
