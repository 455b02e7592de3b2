// Rows of many files as one file, a set union by key in memory that does not grow with the rows: an index of them is
// sorted piece by piece beside the result, and rows are copied from where they stand. The result does not depend on the
// order or the grouping of the sources, and a merge with itself changes nothing. Files may grow while they are read: a
// last line without its newline is left out.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "duet/rows/folder/run_directory.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

struct RowSource {
  std::string path;  // JSON lines; a file that is not there has no rows
  std::string from;  // whose rows they are, in messages: "runs/mine", "runs/a on n1"
  int run = 0;       // of several that are united
  int shard = -1;    // of a planned run (cluster/shard_plan.h)
  std::string node;  // that made the rows; empty: not known
};

// Two nodes that both ran some episodes, the first by name.
using NodePair = std::pair<std::string, std::string>;
struct NodeAgreement {
  std::int64_t compared = 0, different = 0;
};

struct MergedRows {
  std::int64_t rows = 0;                         // of the result
  std::int64_t folded = 0;                       // left out: equal to another one
  std::int64_t superseded = 0;                   // left out: errors and time-outs of episodes that have another row
  int torn = 0;                                  // files whose last line is not whole
  std::int64_t errors = 0, timeouts = 0;         // rows of the result with these outcomes
  std::map<int, std::int64_t> of_run, of_shard;  // how many different episodes each has
  std::map<std::string, std::int64_t> of_node;   // rows of the result
  std::map<NodePair, NodeAgreement> agreement;
  std::int64_t violations = 0;         // episodes with rows that differ: they must not
  std::vector<std::string> conflicts;  // the first kMostConflicts of them: the episode, both sources, the fields
};

inline constexpr std::size_t kMostConflicts = 100;

struct MergeBudget {
  std::size_t entries = 150'000;  // rows whose index is held at once, some 300 bytes each
};

// Writes the rows by engine, controller, perturbation, arm, policy, task, clip and episode to `output`, at once: it is
// there whole or as it was. The earliest of equal rows stays; errors and time-outs give way (rows/row_file.h).
// Where rows differ nothing is written. Throws InputError: a broken row (file and line), one of another suite, a name
// of two digests; StorageError.
MergedRows merge_rows(const std::vector<RowSource>& sources, const RunInfo& info, const std::string& output,
                      const MergeBudget& budget = {});

// Several runs of one suite as one: what two people ran, each with a policy of their own, in one table. Rows are united
// by key; an episode that several runs have, as the null arm's, is there once. The order of the runs does not matter.

struct MergedRuns {
  Run run;             // rows by engine, controller, perturbation, arm, policy, task, clip and episode
  int folded = 0;      // rows that more than one run has, equal in every field that repeats
  int superseded = 0;  // errors and time-outs of episodes that have another row
  std::vector<std::string>
      conflicts;  // of those that are not equal: the episode, both runs, the fields with both values
};

// The path, the suite.yaml and the command line are those of the first run, created_at the earliest, the environment
// the first by its text with the others in `others`. Throws InputError for runs of different suites and for a policy,
// controller or engine profile of two digests under one name.
MergedRuns merge_loaded(const std::vector<Run>& runs);

// The run.json of all together, from what each says, how many rows each has and how many there are in all.
// Throws InputError for runs of different suites and for a policy or controller of two digests under one name.
RunInfo united_info(const std::vector<Run>& runs, const std::vector<std::int64_t>& rows_of_each, std::int64_t rows);

// The environments of all, each once, the first by its text with the others in `others`.
nlohmann::json united_environment(const std::vector<Run>& runs);

// merge_loaded() where a conflict is an error: throws InputError with the first and how many there are. Rows of one run
// alone are moved, and may be lean.
Run united(std::vector<Run> runs);

}  // namespace duet
