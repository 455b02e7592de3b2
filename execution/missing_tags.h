// Tags (core/task.h) of rows from before there were any: from the suite that their run keeps.
#pragma once

#include <vector>

#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Gives the rows that have none what their run's suite says of them. Clips of files are then taken for recorded where
// the suite synthesises others for them, and say nothing of their people where it does not. False: no suite can be read
// that says it; the rows stay as they are.
bool add_missing_tags(const RunInfo& info, std::vector<EpisodeRow>& rows);
// The same of a run, with a sentence among its warnings where it is false.
void add_missing_tags(Run& run);

}  // namespace duet
