#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <mutex>

#include "duet/core/machine.h"

namespace duet {
namespace {

// Work that waits for a caller (a plan, another process) needs no core: each of the calls waits here until all are
// there.
TEST(ParallelForEach, MakesAsManyCallsAtOnceAsItIsAskedFor) {
  const int threads = 4 * default_threads();
  std::mutex mutex;
  std::condition_variable all;
  int there = 0, met = 0;
  parallel_for_each(threads, threads, [&](int) {
    std::unique_lock lock(mutex);
    ++there;
    all.notify_all();
    if (all.wait_for(lock, std::chrono::seconds(30), [&] { return there == threads; })) ++met;
  });
  EXPECT_EQ(met, threads);
}

}  // namespace
}  // namespace duet
