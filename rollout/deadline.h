// Whether an episode has to end though nothing happened in it: the wall-clock limit, or somebody asked.
#pragma once

#include <chrono>
#include <functional>

namespace duet {

class Deadline {
 public:
  using Clock = std::chrono::steady_clock;
  // `seconds` from now. Refers to `stop_asked`, which may be empty.
  Deadline(double seconds, const std::function<bool()>& stop_asked)
      : stop_asked_(stop_asked),
        end_(Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds))) {}
  [[nodiscard]] bool stop_asked() const { return stop_asked_ && stop_asked_(); }
  [[nodiscard]] bool passed() const { return Clock::now() > end_; }
  void extend(Clock::duration time) { end_ += time; }

 private:
  const std::function<bool()>& stop_asked_;
  Clock::time_point end_;
};

}  // namespace duet
