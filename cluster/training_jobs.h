// Trainings as shards of a plan: each seed of each arm is a `duet train` of its own, in a folder of its own below
// trainings/ of the run, started by `duet work` as any other shard is.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"
#include "duet/cluster/work_summary.h"
#include "duet/experiment/plan/trust.h"
#include "duet/experiment/work/stop_sign.h"

namespace duet {

// A file of trainings (duet.trainings/1): what `duet train` is given.
struct TrainingList {
  std::string train;                            // one of training_names()
  std::map<std::string, TrainingOptions> arms;  // name -> options, those of every training included
  std::vector<std::uint64_t> seeds;
  double minutes = 10.0;  // that one takes, as far as is known: for `duet submit` and `duet status`
};

// Throws InputError: file, line, expected, found.
TrainingList parse_trainings(const std::string& yaml, const std::string& file);

// A folder with the plan of them, a shard each, arm by arm. Paths in their arguments start at the run directory. Throws
// InputError for a folder that is planned already or is not empty.
ShardPlan plan_trainings(const TrainingList& list, const std::string& directory);

// The programs that its shards start, for require_allowed (experiment/plan/trust.h): one that is complete, too.
std::vector<NamedProgram> programs_of(const ShardPlan& plan, const std::string& run);

// Runs the shard's training in this process's place, as a child that gets its signals, unless it is complete. The
// child goes on from its last checkpoint. Throws InputError for another program than was planned with, and for a
// training that is not allowed.
WorkSummary work_training(const std::string& run, const ShardPlan& plan, std::int64_t shard, bool allow_programs,
                          const StopSign& stop);

}  // namespace duet
