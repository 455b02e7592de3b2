// Faults of a twin by script: what goes wrong, from when to when. One owner, one thread; randomness by a seed.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "duet/core/random.h"
#include "duet/hardware/twin_model.h"

namespace duet {

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
