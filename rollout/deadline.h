// Whether an episode has to end though nothing happened in it: its limit, or somebody asked.
#pragma once

#include <functional>
#include <utility>

#include "duet/core/awake_time.h"

namespace duet {

// The two clocks that measure an episode's limit [s]; each may start anywhere.
struct EpisodeClock {
  AwakeTime::Clock wall = monotonic_seconds;
  std::function<double()> computed = thread_computed_seconds;  // of the thread that rolls the episode out
};

// A world that waits instead of computing, or has a small share of a core, may take so many times the limit.
inline constexpr double kWaitingShare = 100.0;

// The limit is on what the thread computes: a process that is stopped, and one of many on a core, loses nothing. One
// thread makes it and looks at it.
class Deadline {
 public:
  // `seconds` from now. Refers to `stop_asked`, which may be empty.
  Deadline(double seconds, const std::function<bool()>& stop_asked, const EpisodeClock& clock)
      : stop_asked_(stop_asked),
        seconds_(seconds),
        computed_(clock.computed),
        begin_(computed_()),
        awake_(clock.wall) {}
  [[nodiscard]] bool stop_asked() const { return stop_asked_ && stop_asked_(); }
  [[nodiscard]] bool passed() { return computed_() - begin_ > seconds_ || awake_.look() > kWaitingShare * seconds_; }
  // The time between pause() and go_on() does not count.
  void pause() {
    static_cast<void>(awake_.look());
    paused_ = computed_();
  }
  void go_on() {
    awake_.skip();
    begin_ += computed_() - paused_;
  }

 private:
  const std::function<bool()>& stop_asked_;
  double seconds_;
  std::function<double()> computed_;
  double begin_, paused_ = 0.0;  // by computed_
  AwakeTime awake_;
};

}  // namespace duet
