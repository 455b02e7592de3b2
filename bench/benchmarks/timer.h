// CPU time of this thread and what a loop of it costs: the clock of every figure of `duet bench`.
#pragma once

#include <functional>

namespace duet {

double cpu_seconds();   // of this thread [s]
double wall_seconds();  // monotonic [s]

// CPU seconds of one call: repeats `work` in batches until about `seconds` have passed and takes the best batch, so
// that other load on the machine disturbs little.
double best_call_seconds(const std::function<void()>& work, double seconds);

}  // namespace duet
