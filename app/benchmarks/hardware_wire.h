// The benchmark of the robot's wire, for the registry.
#pragma once

#include <vector>

#include "duet/app/benchmarks/benchmark.h"

namespace duet {

void add_wire_benchmark(std::vector<Benchmark>& list);

}  // namespace duet
