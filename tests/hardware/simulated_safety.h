// A safety machine with a simulated clock and inputs that are all well, for tests: each tick refreshes every link but
// those that are cut.
#pragma once

#include <functional>

#include "duet/hardware/safety/safety_machine.h"

namespace duet::test {

inline constexpr double kTick = 0.002;

struct SimulatedSafety {
  SimulatedSafety() { input.now = 100.0; }

  // One tick with everything well, then `spoil`.
  void tick(const std::function<void(SafetyInput&)>& spoil = {}) {
    input.now += kTick;
    input.period = kTick;
    input.state_at = input.planner_at = input.person_at = input.odometry_at = input.remote_at = input.now;
    input.dead_man_at = input.now;
    input.bad_states = 0;
    if (spoil) spoil(input);
    memory = next_safety(rules, memory, input);
  }
  void run_for(double seconds, const std::function<void(SafetyInput&)>& spoil = {}) {
    for (double left = seconds; left > 0.5 * kTick; left -= kTick) tick(spoil);
  }
  // With everything well, along the way that an operator takes.
  void go_to(SafetyState state) {
    tick();
    if (state == SafetyState::kListen) return;
    run_for(2.1);
    if (state == SafetyState::kReady) return;
    tick([](SafetyInput& in) { in.arm = true; });
    input.arm = false;
    if (state == SafetyState::kArmed) return;
    tick([](SafetyInput& in) { in.stand = true; });
    input.stand = false;
    input.stands = true;
    if (state == SafetyState::kStand) return;
    tick([](SafetyInput& in) { in.run = true; });
    input.run = false;
  }
  [[nodiscard]] SafetyOrder order() const { return safety_order(rules, memory, input); }
  // Ticks with a link cut until the state is left, at most `most` seconds; how long that took [s].
  double time_to_leave(SafetyState state, const std::function<void(SafetyInput&)>& spoil, double most = 5.0) {
    const double begin = input.now;
    while (memory.state == state && input.now - begin < most) tick(spoil);
    return input.now - begin;
  }

  SafetyRules rules;
  SafetyInput input;
  SafetyMemory memory;
};

}  // namespace duet::test
