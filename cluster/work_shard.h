// One shard of a planned run by one worker (`duet work`): what is missing of it, into files of the worker's own.
// Anything that can count may start workers, also many of one shard at once: rows of one episode are equal, and each
// worker leaves out what another one has done.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"

namespace duet {

// The summary of a worker's work.
struct WorkSummary {
  std::int64_t planned = 0, already_there = 0, run = 0;
  std::map<std::string, int> outcomes;  // of those run now
  std::string first_error = {};         // which episode and what it says; "" where none of them ended so
  std::int64_t poisoned = 0;            // of these: rows of episodes that killed their workers
  RunEnd end = RunEnd::kComplete;
  int exit_code = 0;  // of a training: of `duet train`
};

// An episode that crashed so many workers becomes a row with outcome `error`: the next worker would crash as well.
inline constexpr int kMostCrashes = 2;
// The same for workers that vanished while they were at it, as those do that are out of memory. The limit is higher,
// because nodes die and people kill jobs.
inline constexpr int kMostLosses = 5;
// A worker that wrote nothing for so long counts as dead where its process cannot be asked for. [s]
inline constexpr double kSilence = 300.0;

struct WorkOptions {
  int threads = 1;
  bool retry_errors = false;    // episodes that ended with an error run again, those that killed their workers too
  bool allow_programs = false;  // those of policies, and trainings
};

// Throws InputError and MissingError as PlannedRun, StorageError for a disk that takes no row (nothing is lost, no
// episode fails by it), std::invalid_argument for a shard that the plan does not have.
WorkSummary work_shard(const std::string& run, std::int64_t shard, const WorkOptions& options, const StopToken& stop,
                       Progress& progress);

// Trainings as shards of a plan: each seed of each arm is a `duet train` of its own, in a folder of its own below
// trainings/ of the run, started by `duet work` as any other shard is.

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

// The programs that its shards start, for require_allowed (experiment/plan/embodiments.h): one that is complete, too.
std::vector<NamedProgram> programs_of(const ShardPlan& plan, const std::string& run);

// Runs the shard's training in this process's place, as a child that gets its signals, unless it is complete. The
// child goes on from its last checkpoint. Throws InputError for another program than was planned with, and for a
// training that is not allowed.
WorkSummary work_training(const std::string& run, const ShardPlan& plan, std::int64_t shard, bool allow_programs,
                          const StopToken& stop);

}  // namespace duet
