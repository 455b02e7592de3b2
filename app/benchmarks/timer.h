// CPU time of this thread, what a loop of it costs, memory: the clock and the scales of `duet bench`.
#pragma once

#include <functional>

namespace duet {

double cpu_seconds();       // of this thread [s]
double wall_seconds();      // monotonic [s]
double peak_memory_mib();   // largest resident memory of this process so far, or since the next function was called
void forget_peak_memory();  // gives the system back what is free, too

// CPU seconds of one call: repeats `work` in batches until about `seconds` have passed and takes the best batch, so
// that other load on the machine disturbs little.
double best_call_seconds(const std::function<void()>& work, double seconds);

}  // namespace duet
