// How much memory this process may still take, asked before work whose need is known, so that a clip of an hour ends in
// a sentence before the work and not in std::bad_alloc after minutes of it. Thread-safe.
#pragma once

#include <string>

namespace duet {

// The least of what the machine has free (MemAvailable), what the limits of the control groups leave (versions 1 and
// 2), and what RLIMIT_AS (`ulimit -v`) leaves [bytes]; infinity where none of them is known. `root` stands before /proc
// and /sys.
double memory_left(const std::string& root = "");

// Throws InputError where `bytes` are more than are left: "clip 'hour': 180000 frames need about 4.0 GB of memory, and
// 2.1 GB are left"; `work` is its beginning up to "need". Asks nothing for less than 256 MB.
void require_memory(const std::string& work, double bytes);

}  // namespace duet
