// Which of the robot's motions are allowed now: a state machine as a pure function of the state before, the inputs and
// the caller's clock. docs/hardware.md, "States". It commands nothing; what it allows still passes the limiter.
#pragma once

#include <string_view>

#include "duet/hardware/safety_signal.h"

namespace duet {

enum class SafetyState {
  kOffline,  // no robot has been heard of
  kListen,   // it is heard; something is missing before arming
  kReady,    // everything has been well for SafetyRules::ready_time
  kArmed,    // the operator has armed: joints are damped
  kStand,    // goes to its stance, and stands there
  kRun,      // follows the planner
  kHold,     // root at rest, arms frozen, gains as they were
  kDamp,     // joints are damped, for SafetyRules::damp_time
  kFault,    // damped until this program is started anew
};
inline constexpr int kSafetyStates = 9;
std::string_view safety_state_name(SafetyState state);  // "offline", ...

struct SafetyMemory {
  SafetyState state = SafetyState::kOffline;
  StopCause cause = StopCause::kNone;  // of the last hold, damping or fall back to listening
  double since = 0.0;                  // begin of the state [s]
  double well_since = kNever;          // from when everything that arming needs has been well; kNever: it is not
  double last_now = kNever;            // of the tick before
  std::string_view missing = {};       // why it was last not ready, while it listens
  BadStates bad;
};

// The actions that a state allows.
struct SafetyOrder {
  bool writes = false;  // something is sent to the robot
  bool damps = false;   // and it is damping
  bool stands = false;  // or going to, and keeping, the stance
  double share = 0.0;   // of all speeds of planned motion
  bool opens = false;   // the arms open: a hold that will end in damping
};

// One tick. `input.now` does not fall; where it does, the machine damps.
SafetyMemory next_safety(const SafetyRules& rules, const SafetyMemory& before, const SafetyInput& input);

SafetyOrder safety_order(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input);

// The condition that is missing for arming; empty where none is.
std::string_view missing_for_arming(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input);

}  // namespace duet
