#include "duet/hardware/real_time.h"

#include <sched.h>
#include <sys/prctl.h>

namespace duet {
namespace {

constexpr int kPriority = 80;  // of 1 to 99: above usual programs and the kernel's own interrupt threads (50)

}  // namespace

void ask_for_sharp_timers() { (void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); }

bool ask_for_real_time() {
  ask_for_sharp_timers();
  const sched_param parameter{.sched_priority = kPriority};
  return sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
}

}  // namespace duet
