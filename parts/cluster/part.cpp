#include "duet/parts/cluster/part.h"

namespace duet {

Part cluster_part() {
  return {.name = "cluster",
          .commands = {{"plan", cli::add_plan},
                       {"work", cli::add_work},
                       {"submit", cli::add_submit},
                       {"status", cli::add_status},
                       {"merge", cli::add_merge}},
          .extensions = {},
          .lists = {},
          .option_lists = {},
          .benchmarks = {{"scale", add_scale_benchmarks}}};
}

}  // namespace duet
