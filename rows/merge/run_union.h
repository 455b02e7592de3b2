// Several runs of one suite as one: what two people ran, each with a policy of their own, in one table. Rows are united
// by key; an episode that several runs have, as the null arm's, is there once. The order of the runs does not matter.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "duet/rows/folder/run_directory.h"

namespace duet {

struct RunUnion {
  Run run;             // rows by engine, controller, perturbation, arm, policy, task, clip and episode
  int folded = 0;      // rows that more than one run has, equal in every field that repeats
  int superseded = 0;  // errors and time-outs of episodes that have another row
  std::vector<std::string>
      conflicts;  // of those that are not equal: the episode, both runs, the fields with both values
};

// The path, the suite.yaml and the command line are those of the first run, created_at the earliest, the environment
// the first by its text with the others in `others`. Throws InputError for runs of different suites and for a policy,
// controller or engine profile of two digests under one name.
RunUnion unite(const std::vector<Run>& runs);

// The run.json of all together, from what each says, how many rows each has and how many there are in all.
// Throws InputError for runs of different suites and for a policy or controller of two digests under one name.
RunInfo united_info(const std::vector<Run>& runs, const std::vector<std::int64_t>& rows_of_each, std::int64_t rows);

// The environments of all, each once, the first by its text with the others in `others`.
nlohmann::json united_environment(const std::vector<Run>& runs);

// unite() where a conflict is an error: throws InputError with the first and how many there are. Rows of one run alone
// are moved, and may be lean.
Run united(std::vector<Run> runs);

}  // namespace duet
