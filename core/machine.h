// The machine below the program: how long it ran, memory that is left, cores, and instruction sets.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

namespace duet {

// Time in which this process ran. A process that is stopped (SIGSTOP, a suspended machine, a paused container, a
// debugger) does nothing for a while and knows nothing of it; what is limited in time must not be held against that.
// The clock is looked at often; a gap between two looks that is longer than a second is left out. Each object has one
// owner; the time that a thread computed is that of the thread that asks.

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

// How much memory this process may still take, asked before work whose need is known, so that a clip of an hour ends in
// a sentence before the work and not in std::bad_alloc after minutes of it. Thread-safe.

// The least of what the machine has free (MemAvailable), what the limits of the control groups leave (versions 1 and
// 2), and what RLIMIT_AS (`ulimit -v`) leaves [bytes]; infinity where none of them is known. `root` stands before /proc
// and /sys.
double memory_left(const std::string& root = "");

// Throws InputError where `bytes` are more than are left: "clip 'hour': 180000 frames need about 4.0 GB of memory, and
// 2.1 GB are left"; `work` is its beginning up to "need". Asks nothing for less than 256 MB.
void require_memory(const std::string& work, double bytes);

// Work on all cores: one function per index, the first exception is rethrown after the rest has stopped.

// Calls work(i) for i in [0, count) on `threads` threads (oneTBB), in no particular order. An exception stops the
// hand-out of further indices and is rethrown here.
void parallel_for_each(int count, int threads, const std::function<void(int)>& work);

// Cores of this machine, at least 1.
int default_threads();

// Instruction sets that kernel files (PAIR, dense layers) are compiled for, and which of them this processor has.
// Thread-safe.

// Any processor | x86-64-v2 (SSE4.2), x86-64-v3 (AVX2 with FMA), x86-64-v4 (AVX-512). Each x86 set includes those
// before.
enum class InstructionSet { kPortable, kV2, kV3, kV4 };

std::string_view to_string(InstructionSet set);  // "portable", "x86-64-v2", "x86-64-v3", "x86-64-v4"
// Whether code compiled for `set` may be called here. kPortable always may; the others on x86-64 only.
bool runs_here(InstructionSet set);

}  // namespace duet
