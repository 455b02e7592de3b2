// Where the recordings of a replay come from: those that a run kept; other episodes are run again, and the hash of
// their states says whether they are what they were.
#pragma once

#include <string>
#include <vector>

#include "duet/bench/progress.h"
#include "duet/bench/replay/replay_choice.h"
#include "duet/bench/replay/replay_content.h"
#include "duet/results/rows/run_directory.h"

namespace duet {

// Throws as chosen_rows; InputError for a recording that is broken, a robot whose card this machine lacks (it names the
// digest) and as verify_run where episodes have to be run again.
ReplayContent replay_of_run(const Run& run, const ReplayChoice& choice, Progress& progress);

// Recordings of anybody (NPZ), a track each; those of one task, clip and episode are one scene. Throws InputError.
ReplayContent replay_of_files(const std::vector<std::string>& files, const std::string& card);

}  // namespace duet
