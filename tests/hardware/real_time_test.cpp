#include <gtest/gtest.h>
#include <sched.h>

#include <thread>

#include "duet/hardware/guard/guard_loop.h"

namespace duet {
namespace {

TEST(RealTime, IsGivenToTheThreadThatAsksAndToThoseThatItMakes) {
  const int before = sched_getscheduler(0);
  bool given = false;
  int own = -1, made = -1;
  std::thread([&] {
    given = ask_for_real_time();
    own = sched_getscheduler(0);
    std::thread([&] { made = sched_getscheduler(0); }).join();
  }).join();
  EXPECT_EQ(own, given ? SCHED_FIFO : before);
  EXPECT_EQ(made, own);
  EXPECT_EQ(sched_getscheduler(0), before) << "whoever did not ask stays as they were";
}

}  // namespace
}  // namespace duet
