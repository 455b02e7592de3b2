#include "duet/core/parallel.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <thread>

namespace duet {

void parallel_for_each(int count, int threads, const std::function<void(int)>& work) {
  // Indices are handed out in order, so that a stopped run has finished the first episodes and not scattered ones.
  std::atomic<int> next{0};
  // More threads than cores are of use where the work waits for somebody: oneTBB gives them only where it is told to.
  std::optional<tbb::global_control> more;
  if (threads > default_threads()) more.emplace(tbb::global_control::max_allowed_parallelism, threads);
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(
        0, std::min(threads, count),
        [&](int) {
          for (int i = next++; i < count; i = next++) {
            try {
              work(i);
            } catch (...) {
              next = count;
              throw;
            }
          }
        },
        tbb::static_partitioner());
  });
}

int default_threads() { return std::max(1U, std::thread::hardware_concurrency()); }

}  // namespace duet
