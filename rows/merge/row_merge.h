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
// there whole or as it was. The earliest of equal rows stays; errors and time-outs give way (row_identity.h).
// Where rows differ nothing is written. Throws InputError: a broken row (file and line), one of another suite, a name
// of two digests; StorageError.
MergedRows merge_rows(const std::vector<RowSource>& sources, const RunInfo& info, const std::string& output,
                      const MergeBudget& budget = {});

}  // namespace duet
