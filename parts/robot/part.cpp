#include "duet/parts/robot/part.h"

namespace duet {

Part robot_part() {
  return {.name = "robot",
          .commands = {{"hw", cli::add_hardware}, {"replay-log", cli::add_replay_log}},
          .extensions = {},
          .lists = {},
          .option_lists = {},
          .benchmarks = {{"hardware", [](std::vector<Benchmark>& list) {
                            add_hardware_benchmarks(list);
                            add_wire_benchmark(list);
                          }}}};
}

}  // namespace duet
