// Makes a run that many machines work on (`duet plan`): the folder of a run without rows, its clips ready, and the
// plan.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"
#include "duet/execution/experiment.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

struct PlanOptions {
  std::int64_t shards = 0;              // 0: by their predicted cost
  std::map<std::string, double> costs;  // as in ShardPlan, of engines and controllers that no pilot is to run for
  int threads = 1;                      // that prepare clips
  EpisodeFilter part = {};              // of the suite that is planned, as `duet run` takes it
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
PlanSummary plan_run(Suite suite, const std::string& directory, const PlanOptions& options, const StopToken& stop,
                     Progress& progress);

// A planned run as a worker opens it: the suite from the folder, held against the plan. Nothing of it names a place on
// this machine, so that every node may have the folder somewhere else. Immutable but for its clips.

class PlannedRun {
 public:
  // Throws InputError: no plan, inputs that are not what they were, another program, suite, policy or controller than
  // was planned with (which, both digests), programs that are not allowed; MissingError for a network that is not
  // found.
  PlannedRun(std::string path, bool allow_programs);
  PlannedRun(const PlannedRun&) = delete;
  PlannedRun& operator=(const PlannedRun&) = delete;

  [[nodiscard]] const std::string& path() const { return head_.path; }
  [[nodiscard]] const RunInfo& info() const { return head_.info; }
  [[nodiscard]] const ShardPlan& plan() const { return plan_; }
  [[nodiscard]] const Experiment& experiment() const { return experiment_; }

  // Reads the clips of these places, and of no others. Throws InputError for one that is not what was planned with.
  void load_clips(std::int64_t begin, std::int64_t end);

 private:
  Run head_;
  ShardPlan plan_;
  Experiment experiment_;
};

// SHA-256 over the keys of these places in their order.
std::string keys_digest(const Experiment& experiment, std::int64_t begin, std::int64_t end);

}  // namespace duet
