// One control period: the physics steps between two commands of a controller. Every loop of the project (an episode, a
// robot that learns, a test) steps a robot under a controller through it.
#pragma once

#include <algorithm>
#include <cmath>

#include "duet/backends/backend.h"
#include "duet/core/clock.h"

namespace duet {

// Physics steps of `dt` [s] in a control period of 20 ms, at least one.
inline int steps_per_tick(double dt) { return std::max(1, static_cast<int>(std::lround(kTick / dt))); }

// `command_at(i)` is what the joints receive in step i; `after(i)`, called after each step that went well, returns
// whether to go on (kTimedOut where it does not). Otherwise the outcome of the last step.
template <typename CommandAt, typename After>
Outcome step_control_period(Backend& backend, int steps, const CommandAt& command_at, const After& after) {
  for (int i = 0; i < steps; ++i) {
    const Outcome outcome = backend.step(command_at(i));
    if (outcome != Outcome::kOk) return outcome;
    if (!after(i)) return Outcome::kTimedOut;
  }
  return Outcome::kOk;
}

// The same with one command throughout.
inline Outcome step_control_period(Backend& backend, int steps, const JointCommand& command) {
  return step_control_period(
      backend, steps, [&](int) -> const JointCommand& { return command; }, [](int) { return true; });
}

}  // namespace duet
