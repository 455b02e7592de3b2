// A perturbation at work in one episode: between the engine's state and the controller, between the controller's
// command and the joints, and on the robot. Nothing allocates after construction; not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/core/random.h"
#include "duet/robots/kinematics.h"
#include "duet/rollout/perturbation.h"

namespace duet {

class Disturbance {
 public:
  // `start` is what the controller sees of the time before the episode, and what the joints hold until the first
  // command arrives. `steps_per_tick` physics steps of `dt` [s] are one control tick.
  Disturbance(const Perturbation& perturbation, const RobotModel& robot, const RobotState& start, int steps_per_tick,
              double dt, std::uint64_t seed);

  // What the controller sees at this tick; once per tick. Without delay and noise `state` itself.
  const RobotState& seen(const RobotState& state);
  // The command of this tick; once per tick. Copies.
  void send(const JointCommand& command);
  // The command that is in effect in a physics step of this tick, counted from 0.
  [[nodiscard]] const JointCommand& in_effect(int step) const;
  // Begins and ends pushes, and kicks; before the physics steps of `tick`.
  void push(int tick, Backend& backend);

 private:
  void add_noise(RobotState& state);
  void kick(int tick, Backend& backend);

  Perturbation perturbation_;
  const RobotModel& robot_;
  Random noise_, direction_, kick_;

  std::vector<RobotState> past_;  // a ring of the last delay_ticks + 1 states
  std::size_t newest_ = 0;
  RobotState seen_;

  int steps_per_tick_;
  int late_steps_;                      // from a command to its effect
  std::vector<JointCommand> commands_;  // a ring of the latest, newest at latest_
  std::size_t latest_ = 0;

  Kinematics kinematics_;
  int link_ = -1;
  int push_ticks_ = 0, every_ticks_ = 0;
  bool pushing_ = false;
  int next_kick_ = 0;  // tick
};

}  // namespace duet
