// The part `robot`: the commands of a real robot and of its twin, `duet hw` and `duet replay-log`.
#pragma once

#include "duet/app/part.h"

namespace duet {

Part robot_part();
void add_hardware_benchmarks(std::vector<Benchmark>& list);
void add_wire_benchmark(std::vector<Benchmark>& list);

}  // namespace duet

namespace duet::cli {

void add_hardware(CLI::App& app, Session& session);
void add_replay_log(CLI::App& app, Session& session);

}  // namespace duet::cli
