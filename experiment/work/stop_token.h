// Tells every loop that asks whether a run stops early: a signal, the time limit of the command, or a program
// that runs suites and has its own reasons. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace duet {

enum class RunEnd { kComplete, kTimeLimit, kInterrupted, kTerminated };

class StopToken {
 public:
  using Clock = std::chrono::steady_clock;

  // `limit` [s] counts from `begin`; 0 is none. `stop_asked`, where there is one, stops as an interrupt does; it is
  // called from any thread.
  explicit StopToken(double limit = 0.0, Clock::time_point begin = Clock::now(), std::function<bool()> stop_asked = {})
      : limit_(limit), begin_(begin), stop_asked_(std::move(stop_asked)) {}
  // kComplete: go on.
  [[nodiscard]] RunEnd end() const;
  [[nodiscard]] bool asked() const { return end() != RunEnd::kComplete; }

 private:
  double limit_;
  Clock::time_point begin_;
  std::function<bool()> stop_asked_;
};

// Thrown by work that ends because of the sign.
struct Stopped {};

// Calls `act` once where this object still lives `grace` seconds after the sign: for work that cannot be asked to stop
// (a network that loads, a file that is hashed). On a thread of its own.
class Watchdog {
 public:
  Watchdog(const StopToken& sign, double grace, std::function<void(RunEnd)> act);
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

 private:
  bool released_after(double seconds);
  void watch(double grace);

  const StopToken& sign_;
  std::function<void(RunEnd)> act_;
  std::mutex mutex_;
  std::condition_variable released_;
  bool over_ = false;
  std::thread thread_;
};

// Ctrl-C, SIGTERM and SIGHUP (a connection that is lost) as a question that loops ask. A second Ctrl-C ends the program
// at once.

enum class Interrupt { kNone, kInterrupted, kTerminated };  // SIGINT (exit code 130), SIGTERM or SIGHUP (75)

// From now on the signals set the answer of interrupt() instead of ending the program. SIGHUP stays
// ignored where it was (nohup).
void catch_interrupts();
Interrupt interrupt();

}  // namespace duet
