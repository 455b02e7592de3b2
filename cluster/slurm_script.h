// The scripts that run a planned run on a Slurm cluster (`duet submit --slurm`): an array of workers, and a job that
// merges when they have ended. Slurm is the queue: it starts, restarts and counts the workers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "duet/cluster/run_status.h"

namespace duet {

struct SlurmOptions {
  std::string partition, account, qos, time = "01:00:00", memory, constraint;  // as sbatch reads them; empty: not said
  int threads = 1;                                                             // of a worker
  int at_once = 0;                   // workers at the same time; 0: as many as there are places
  std::vector<std::string> more;     // further options of sbatch, whole: "--exclude=n7"
  std::vector<std::string> set_up;   // lines that the script runs first: "module load ..."
  std::vector<std::string> program;  // words by which the nodes call duet: {"apptainer", "exec", "duet.sif", "duet"}
  bool allow_programs = false;       // the workers may start what the plan names (experiment/plan/trust.h)
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
