// Time in which this process ran. A process that is stopped (SIGSTOP, a suspended machine, a paused container, a
// debugger) does nothing for a while and knows nothing of it; what is limited in time must not be held against that.
// The clock is looked at often; a gap between two looks that is longer than a second is left out. Each object has one
// owner; the time that a thread computed is that of the thread that asks.
#pragma once

#include <chrono>
#include <functional>
#include <utility>

namespace duet {

double monotonic_seconds();        // CLOCK_MONOTONIC [s]
double thread_computed_seconds();  // that the calling thread has computed for [s]

inline constexpr double kLongestGap = 1.0;  // between two looks that counts [s]; scheduler and disk stay far below it

class AwakeTime {
 public:
  using Clock = std::function<double()>;  // [s], from any beginning
  explicit AwakeTime(Clock clock = monotonic_seconds) : clock_(std::move(clock)), last_(clock_()) {}

  // A look: since the object was made [s], without long gaps between two looks and without what was skipped.
  double look();
  // Leaves out the time that passed since the last look.
  void skip() { last_ = clock_(); }

 private:
  Clock clock_;
  double last_, awake_ = 0.0;
};

// For waits: a time from now on. The waiting thread looks every 100 ms.
class AwakeDeadline {
 public:
  explicit AwakeDeadline(std::chrono::milliseconds time, AwakeTime awake = AwakeTime())
      : time_(time), awake_(std::move(awake)) {}
  // A look. Rounded up, at least 0.
  std::chrono::milliseconds left();
  bool passed() { return left().count() == 0; }

 private:
  std::chrono::milliseconds time_;
  AwakeTime awake_;
};

}  // namespace duet
