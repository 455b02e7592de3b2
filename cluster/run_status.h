// How far a planned run is (`duet status`), from the journals of its workers; rows are read only of workers that were
// killed. Nothing is locked or written but a file of a moment that tells the time of the file system.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"

namespace duet {

// done: all episodes have rows; running: a worker may be at it; failed: a training that ended with an error; stopped:
// it was begun and nobody is at it, so that a worker has to be started again; waiting: nobody began.
enum class ShardState { kDone, kRunning, kFailed, kStopped, kWaiting };
std::string_view to_string(ShardState state);

struct ShardStatus {
  ShardState state = ShardState::kWaiting;
  std::int64_t number = 0, episodes = 0, done = 0, errors = 0, timeouts = 0;  // done: with a row of any outcome
  std::int64_t attempts = 0, running = 0, crashes = 0;                        // running: attempts that may be at work
  std::vector<std::string> nodes;                                             // of those
};

struct NodeStatus {
  std::int64_t done = 0, errors = 0, running = 0, attempts = 0, lost = 0, crashes = 0;
  double seconds = 0.0;  // of the episodes that are done
};

struct RunStatus {
  ShardPlan::Kind kind = ShardPlan::Kind::kEpisodes;
  std::int64_t episodes = 0, done = 0, errors = 0, timeouts = 0, running = 0;
  double seconds_left = -1.0;  // at the rate so far, by as many workers as are running; below 0: none is
  std::vector<ShardStatus> shards;
  std::map<std::string, NodeStatus> nodes;

  [[nodiscard]] bool is_complete() const { return done == episodes; }
  // Numbers of the shards in a state, as `sbatch --array` takes them: "0-3,7".
  [[nodiscard]] std::string numbers(const std::vector<ShardState>& states) const;
};

// Throws InputError as read_shard_plan and for a journal of something else.
RunStatus run_status(const std::string& run);

std::string status_text(const RunStatus& status);
nlohmann::json status_json(const RunStatus& status);

// "0-3,7" of sorted numbers.
std::string ranges_text(const std::vector<std::int64_t>& numbers);

// The scripts that run a planned run on a Slurm cluster (`duet submit --slurm`): an array of workers, and a job that
// merges when they have ended. Slurm is the queue: it starts, restarts and counts the workers.

struct SlurmOptions {
  std::string partition, account, qos, time = "01:00:00", memory, constraint;  // as sbatch reads them; empty: not said
  int threads = 1;                                                             // of a worker
  int at_once = 0;                   // workers at the same time; 0: as many as there are places
  std::vector<std::string> more;     // further options of sbatch, whole: "--exclude=n7"
  std::vector<std::string> set_up;   // lines that the script runs first: "module load ..."
  std::vector<std::string> program;  // words by which the nodes call duet: {"apptainer", "exec", "duet.sif", "duet"}
  bool allow_programs = false;       // the workers may start what the plan names (experiment/plan/embodiments.h)
  int largest_array = 1000;          // shards of one array (MaxArraySize)
};

struct SlurmJobs {
  std::string array_script, merge_script;  // texts
  std::vector<std::string> arrays;         // --array of each job that is submitted, of the numbers less `offsets`
  std::vector<std::int64_t> offsets;
};

// Jobs for the shards that are not done. `run`: as the nodes find it. Throws std::invalid_argument for an option with a
// line end in it, for a value that sbatch has no quotes for, and where nothing is left to do.
SlurmJobs slurm_jobs(const RunStatus& status, const std::string& run, const SlurmOptions& options);

struct SlurmSubmission {
  std::vector<std::string> jobs;  // ids of the arrays
  std::string merge;              // id of the job that merges; empty for trainings, which have no rows
};

// Writes slurm/array.sh and slurm/merge.sh into the run; throws StorageError.
void write_slurm_scripts(const SlurmJobs& jobs, const std::string& run);
// Hands them to `sbatch`. Throws MissingError where it is not there, InputError with what it says.
SlurmSubmission submit_slurm_jobs(const SlurmJobs& jobs, const RunStatus& status, const std::string& run);
bool has_sbatch();

}  // namespace duet
