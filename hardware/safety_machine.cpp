#include "duet/hardware/safety_machine.h"

#include <array>

namespace duet {
namespace {

constexpr std::array<std::string_view, kSafetyStates> kStateNames = {"offline", "listen", "ready", "armed", "stand",
                                                                     "run",     "hold",   "damp",  "fault"};

void enter(SafetyState state, StopCause cause, double now, SafetyMemory& memory) {
  memory.state = state;
  memory.cause = cause;
  memory.since = now;
}

void listen(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const std::string_view missing = missing_for_arming(rules, memory, input);
  const bool well = missing.empty();
  if (!well) {
    memory.well_since = kNever;
    memory.missing = missing;
  }
  if (well && memory.well_since == kNever) memory.well_since = input.now;
  const bool ready = well && input.now - memory.well_since >= rules.ready_time;
  if (memory.state == SafetyState::kListen && ready) enter(SafetyState::kReady, StopCause::kNone, input.now, memory);
  if (memory.state == SafetyState::kReady && !ready) enter(SafetyState::kListen, StopCause::kNone, input.now, memory);
  if (memory.state == SafetyState::kReady && input.arm) enter(SafetyState::kArmed, StopCause::kNone, input.now, memory);
}

// Whether the signals have ended the state.
bool stopped(const SafetyRules& rules, const SafetyInput& input, bool moving, SafetyMemory& memory) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, moving);
  if (found.level == StopLevel::kDamp)
    enter(SafetyState::kDamp, found.cause, input.now, memory);
  else if (found.level == StopLevel::kHold)
    enter(SafetyState::kHold, found.cause, input.now, memory);
  return found.level >= StopLevel::kHold;
}

// Damped already: what would hold anything else ends the arming.
void wait_armed(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, false);
  if (found.level >= StopLevel::kHold) return enter(SafetyState::kDamp, found.cause, input.now, memory);
  if (input.now - memory.since > rules.armed_time)
    return enter(SafetyState::kDamp, StopCause::kLapsed, input.now, memory);
  if (input.stand) enter(SafetyState::kStand, StopCause::kNone, input.now, memory);
}

void stand(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  if (stopped(rules, input, false, memory)) return;
  const bool well = assess(rules, input, memory.bad, memory.last_now, true).level < StopLevel::kHold;
  if (input.run && input.stands && well) enter(SafetyState::kRun, StopCause::kNone, input.now, memory);
}

// Whether a hold may still end in running.
bool may_return(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input) {
  return memory.cause == StopCause::kPlannerAge && input.now - memory.since <= rules.hold_time &&
         level_of(input.now - input.planner_at, rules.planner) < StopLevel::kDamp;
}

// Back to running only where nothing but the planner was late, and not for long. Everything else ends in damping, once
// the hands are off the person.
void hold(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, true);
  if (found.level == StopLevel::kDamp && found.cause != StopCause::kPlannerAge)
    return enter(SafetyState::kDamp, found.cause, input.now, memory);
  if (found.level >= StopLevel::kHold && found.cause != StopCause::kPlannerAge) memory.cause = found.cause;
  if (may_return(rules, memory, input)) {
    if (found.level < StopLevel::kHold) enter(SafetyState::kRun, StopCause::kNone, input.now, memory);
    return;
  }
  if (!input.hands_clear) return;
  const bool late_planner = memory.cause == StopCause::kPlannerAge;
  enter(SafetyState::kDamp, late_planner ? StopCause::kHeldTooLong : memory.cause, input.now, memory);
}

// A stop that the operator asked for, or an arming that lapsed, may be followed by another arming; nothing else.
void damp(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const bool asked_for = memory.cause == StopCause::kStopKey || memory.cause == StopCause::kLapsed;
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, false);
  if (asked_for && found.level == StopLevel::kDamp && found.cause != StopCause::kStopKey) memory.cause = found.cause;
  if (input.now - memory.since < rules.damp_time) return;
  const bool again = memory.cause == StopCause::kStopKey || memory.cause == StopCause::kLapsed;
  memory.well_since = kNever;
  enter(again ? SafetyState::kListen : SafetyState::kFault, memory.cause, input.now, memory);
}

}  // namespace

std::string_view safety_state_name(SafetyState state) { return kStateNames[static_cast<std::size_t>(state)]; }

std::string_view missing_for_arming(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, false);
  if (found.level >= StopLevel::kHold) return stop_cause_name(found.cause);
  if (!input.health.joints_in_range) return "joints_in_range";
  return "";
}

SafetyMemory next_safety(const SafetyRules& rules, const SafetyMemory& before, const SafetyInput& input) {
  SafetyMemory memory = before;
  note_bad_states(input.bad_states, input.now, memory.bad);
  switch (before.state) {
    case SafetyState::kOffline:
      if (input.state_at != kNever) enter(SafetyState::kListen, StopCause::kNone, input.now, memory);
      break;
    case SafetyState::kListen:
    case SafetyState::kReady:
      listen(rules, input, memory);
      break;
    case SafetyState::kArmed:
      wait_armed(rules, input, memory);
      break;
    case SafetyState::kStand:
      stand(rules, input, memory);
      break;
    case SafetyState::kRun:
      stopped(rules, input, true, memory);
      break;
    case SafetyState::kHold:
      hold(rules, input, memory);
      break;
    case SafetyState::kDamp:
      damp(rules, input, memory);
      break;
    case SafetyState::kFault:
      break;
  }
  memory.last_now = input.now;
  return memory;
}

SafetyOrder safety_order(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input) {
  SafetyOrder order;
  order.writes = memory.state >= SafetyState::kArmed;
  order.damps =
      memory.state == SafetyState::kArmed || memory.state == SafetyState::kDamp || memory.state == SafetyState::kFault;
  order.stands = memory.state == SafetyState::kStand;
  if (memory.state == SafetyState::kRun) order.share = planner_share(rules, input.now - input.planner_at);
  order.opens = memory.state == SafetyState::kHold && !may_return(rules, memory, input);
  return order;
}

}  // namespace duet
