// One run directory from several of one suite, or from the attempts of those that many machines work on: a set union of
// rows, in memory that does not grow with them.
#pragma once

#include <string>
#include <vector>

#include "duet/rows/merge/row_merge.h"

namespace duet {

struct MergeOptions {
  std::string output = {};  // a new folder; empty: into the one run itself, which was planned
  std::vector<std::string> argv = {};
  std::vector<std::string> without_nodes = {};  // whose rows are left out
  MergeBudget budget = {};
};

// A shard of a planned run that lacks rows.
struct ShardGap {
  std::string run;
  std::int64_t shard = 0, rows = 0, episodes = 0;
};

struct MergeSummary {
  MergedRows rows;
  std::int64_t planned = 0;    // episodes of the planned runs together
  std::vector<ShardGap> gaps;  // shards whose episodes are not all there
  bool written = false;        // false: rows differ (rows.violations)
};

// Rows may be written to the runs meanwhile: what is whole is taken, and the next merge takes the rest; two merges into
// one run wait for one another. A new folder is there whole or not at all. A planned run that is merged into itself has
// hosts.json beside its rows: what each node is, how many rows it made and how many were held against another node's.
// Throws InputError: runs of several suites, names of two digests, a broken row, an output that is there; without
// output a run that has no plan, or several; std::invalid_argument for a node that has no rows.
MergeSummary merge_runs(const std::vector<std::string>& runs, const MergeOptions& options);

}  // namespace duet
