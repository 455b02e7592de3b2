#include "duet/experiment/work/stop_token.h"

#include <atomic>
#include <csignal>
#include <utility>

namespace duet {
namespace {

constexpr double kGlance = 0.05;  // [s] between two looks at the sign

}  // namespace

RunEnd StopToken::end() const {
  switch (interrupt()) {
    case Interrupt::kInterrupted:
      return RunEnd::kInterrupted;
    case Interrupt::kTerminated:
      return RunEnd::kTerminated;
    case Interrupt::kNone:
      break;
  }
  if (stop_asked_ && stop_asked_()) return RunEnd::kInterrupted;
  const double elapsed = std::chrono::duration<double>(Clock::now() - begin_).count();
  return limit_ > 0.0 && elapsed > limit_ ? RunEnd::kTimeLimit : RunEnd::kComplete;
}

Watchdog::Watchdog(const StopToken& sign, double grace, std::function<void(RunEnd)> act)
    : sign_(sign), act_(std::move(act)), thread_([this, grace] { watch(grace); }) {}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  released_.notify_all();
  thread_.join();
}

bool Watchdog::released_after(double seconds) {
  std::unique_lock lock(mutex_);
  return released_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return over_; });
}

void Watchdog::watch(double grace) {
  while (!sign_.asked())
    if (released_after(kGlance)) return;
  if (!released_after(grace)) act_(sign_.end());
}

namespace {

// A signal handler can reach nothing but a global; lock-free atomics are what the standard allows there.
std::atomic<int> received{0};
static_assert(std::atomic<int>::is_always_lock_free);

void on_signal(int signal) {
  if (received.exchange(signal) != 0) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}

}  // namespace

void catch_interrupts() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  if (std::signal(SIGHUP, on_signal) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);  // under nohup the run goes on
}

Interrupt interrupt() {
  switch (received.load()) {
    case SIGINT:
      return Interrupt::kInterrupted;
    case SIGTERM:
    case SIGHUP:
      return Interrupt::kTerminated;
    default:
      return Interrupt::kNone;
  }
}

}  // namespace duet
