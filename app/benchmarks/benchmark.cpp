#include "duet/app/benchmarks/benchmark.h"

#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <limits>

namespace duet {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double peak_memory_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

void forget_peak_memory() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << 5;  // the kernel's word for it (proc(5))
}

double best_call_seconds(const std::function<void()>& work, double seconds) {
  constexpr double kBatch = 0.02;  // [s] of CPU time: long against the clock's resolution, short against a time slice
  work();
  double begin = cpu_seconds();
  work();
  const int calls = std::max(1, static_cast<int>(kBatch / std::max(cpu_seconds() - begin, 1e-9)));
  double best = std::numeric_limits<double>::infinity();
  const double start = wall_seconds();
  do {
    begin = cpu_seconds();
    for (int i = 0; i < calls; ++i) work();
    best = std::min(best, (cpu_seconds() - begin) / calls);
  } while (wall_seconds() - start < seconds);
  return best;
}

}  // namespace duet
