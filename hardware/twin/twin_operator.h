// The operator of a demonstration: holds the dead-man switch, stands the twin up once it is damped, lets it down from
// its rope once its motors hold it and its arms have come to rest, and asks it to run, again and again, also after a
// hold. Where other programs hold the motors before anybody damped them (HOMIE's, the maker's), nothing at the twin
// shows when the guard is armed: start and A are pressed in turn. A robot that was let down once stays down: damped or
// limp, it falls. One owner, one thread.
#pragma once

#include <array>
#include <deque>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/hardware/twin/twin_model.h"

namespace duet {

class TwinOperator {
 public:
  // Before each step of the twin; `time` is the twin's [s].
  void tick(double time, TwinModel& twin);
  // Whether it asks to run; where it does not, a hold lasts.
  void asks(bool asks) { asks_ = asks; }

 private:
  void look(double time, const TwinModel& twin);
  void press(double time, TwinModel& twin);

  double damped_since_ = 0.0, held_since_ = 0.0, still_since_ = 0.0, let_down_at_ = kNever;
  double pressed_until_ = 0.0, next_press_ = 0.0;
  std::array<float, kG1Motors> targets_{};
  RemoteKey pressed_ = RemoteKey::kA;  // last
  bool stood_ = false, asks_ = true;
};

// Faults of a twin by script: what goes wrong, from when to when. One owner, one thread; randomness by a seed.

enum class TwinFaultKind { kDrop, kDelay, kFlip, kFreeze, kNan, kHot, kTilt, kRemoteLost, kDeadMan, kMode, kCharge };

struct TwinFault {
  TwinFaultKind kind = TwinFaultKind::kDrop;
  double begin = 0.0, end = 0.0;  // of the twin's time [s]
  double value = 0.0;  // drop, flip: of states [%]; delay [ms]; hot [degrees C]; tilt [rad]; charge [%]; else unused
};

std::vector<std::string> twin_fault_names();
// "drop@3:5=100": kind, begin, end, value. Throws std::invalid_argument naming what was expected and found.
TwinFault parse_twin_fault(const std::string& text);

class FaultyTwin {
 public:
  FaultyTwin(TwinModel& twin, std::vector<TwinFault> faults, std::uint64_t seed);
  // The twin's next state; false where none leaves at `time`. Conditions of the twin and its remote control are those
  // of the script.
  bool next_state(double time, LowStateFrame& frame);

 private:
  [[nodiscard]] const TwinFault* active(TwinFaultKind kind, double time) const;
  void set_condition(double time);
  void spoil(double time, LowStateFrame& frame);

  TwinModel& twin_;
  std::vector<TwinFault> faults_;
  Random random_;
  struct LateState {
    double leaves;
    LowStateFrame frame;
  };
  std::deque<LateState> late_;
  std::uint32_t last_tick_ = 0;
};

}  // namespace duet
