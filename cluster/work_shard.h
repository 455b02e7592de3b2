// One shard of a planned run by one worker (`duet work`): what is missing of it, into files of the worker's own.
// Anything that can count may start workers, also many of one shard at once: rows of one episode are equal, and each
// worker leaves out what another one has done.
#pragma once

#include <cstdint>
#include <string>

#include "duet/cluster/work_summary.h"
#include "duet/experiment/work/progress.h"
#include "duet/experiment/work/stop_sign.h"

namespace duet {

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
WorkSummary work_shard(const std::string& run, std::int64_t shard, const WorkOptions& options, const StopSign& stop,
                       Progress& progress);

}  // namespace duet
