#include "duet/core/awake_time.h"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace duet {
namespace {

double seconds_by(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

double monotonic_seconds() { return seconds_by(CLOCK_MONOTONIC); }

double thread_computed_seconds() { return seconds_by(CLOCK_THREAD_CPUTIME_ID); }

double AwakeTime::look() {
  const double now = clock_(), gap = now - last_;
  last_ = now;
  if (gap <= kLongestGap) awake_ += gap;
  return awake_;
}

std::chrono::milliseconds AwakeDeadline::left() {
  const double left = static_cast<double>(time_.count()) - 1000.0 * awake_.look();
  return std::chrono::milliseconds(static_cast<std::int64_t>(std::ceil(std::max(left, 0.0))));
}

}  // namespace duet
