// When a training prints and when it saves, by the wall clock: nothing of the result depends on it.
#pragma once

#include <chrono>

namespace duet {

class Pace {
 public:
  // Since the training began or went on [s].
  [[nodiscard]] double seconds() const { return since(begin_); }
  [[nodiscard]] bool report_due() const { return since(reported_) > 10.0; }
  [[nodiscard]] bool save_due() const { return since(saved_) > 60.0; }
  void reported() { reported_ = Clock::now(); }
  void saved() { saved_ = Clock::now(); }

 private:
  using Clock = std::chrono::steady_clock;
  static double since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

  Clock::time_point begin_ = Clock::now(), reported_ = begin_, saved_ = begin_;
};

}  // namespace duet
