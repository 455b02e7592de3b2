// The benchmarks of the room hardware/, for the registry.
#pragma once

#include <vector>

#include "duet/app/benchmarks/benchmark.h"

namespace duet {

void add_hardware_benchmarks(std::vector<Benchmark>& list);

}  // namespace duet
