// The same work on a fixed number of threads; which thread does what is the caller's and never depends on timing.
#pragma once

#include <functional>

namespace duet {

// Calls f(0) ... f(threads - 1), each on its own thread (the first on this one), and waits. The first exception in the
// order of the numbers is thrown on.
void on_threads(int threads, const std::function<void(int)>& f);

}  // namespace duet
