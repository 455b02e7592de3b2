#include "duet/experiment/work/interrupt.h"

#include <atomic>
#include <csignal>

namespace duet {
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
