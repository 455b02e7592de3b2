// Work on all cores: one function per index, the first exception is rethrown after the rest has stopped.
#pragma once

#include <functional>

namespace duet {

// Calls work(i) for i in [0, count) on `threads` threads (oneTBB), in no particular order. An exception stops the
// hand-out of further indices and is rethrown here.
void parallel_for_each(int count, int threads, const std::function<void(int)>& work);

// Cores of this machine, at least 1.
int default_threads();

}  // namespace duet
