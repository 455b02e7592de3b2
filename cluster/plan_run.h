// Makes a run that many machines work on (`duet plan`): the folder of a run without rows, its clips ready, and the
// plan.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/progress.h"
#include "duet/experiment/work/stop_sign.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

struct PlanOptions {
  std::int64_t shards = 0;              // 0: by their predicted cost
  std::map<std::string, double> costs;  // as in ShardPlan, of engines and controllers that no pilot is to run for
  int threads = 1;                      // that prepare clips
  RunPart part = {};                    // of the suite that is planned, as `duet run` takes it
  std::vector<std::string> argv;
  nlohmann::json certificate;
};

struct PlanSummary {
  ShardPlan plan;
  std::int64_t pilots = 0;            // episodes that were run to measure costs; their rows are in the run
  std::vector<std::string> warnings;  // sentences: what this machine lacks
};

// Costs that are not given are measured: the first clip in each engine and controller, with all policies. The folder
// is planned when plan.json is there; a command that was killed before may be given again. Throws as run_suite, Stopped
// after the sign, and InputError for a folder that is planned already or has rows; std::invalid_argument for costs of
// what the suite does not have.
PlanSummary plan_run(Suite suite, const std::string& directory, const PlanOptions& options, const StopSign& stop,
                     Progress& progress);

}  // namespace duet
