// The same work on a fixed number of threads; which thread does what is the caller's and never depends on timing.
#pragma once

#include <chrono>
#include <functional>

namespace duet {

// Calls f(0) ... f(threads - 1), each on its own thread (the first on this one), and waits. The first exception in the
// order of the numbers is thrown on.
void on_threads(int threads, const std::function<void(int)>& f);

// When a training prints and when it saves, by the wall clock: nothing of the result depends on it.
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
