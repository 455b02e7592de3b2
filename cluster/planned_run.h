// A planned run as a worker opens it: the suite from the folder, held against the plan. Nothing of it names a place on
// this machine, so that every node may have the folder somewhere else. Immutable but for its clips.
#pragma once

#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"
#include "duet/execution/experiment.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

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
