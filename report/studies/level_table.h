// How far a policy or a controller comes on a ladder of difficulty: success at each level, from rows whose suite gives
// their perturbation or clip the tag `level` or `stage`, and with `level_name` or `stage_name` a name. A row is of the
// higher of the two; a clean one whose clip has no level is of level 0. A command to walk forward is passed at half of
// its speed or more. The null arm is left out. Nothing depends on the order of rows.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"

namespace duet {

// A ladder and the success that counts as having passed a level of it.
struct Ladder {
  std::string_view word, title;
  double pass;
};
inline constexpr std::array<Ladder, 2> kLadders = {{
    {"level", "Levels", 0.5},   // of suites for policies
    {"stage", "Stages", 0.95},  // of suites for controllers, as suites/wbc_gates.yaml asks of pushes
}};

struct LevelName {
  int level = 0;
  std::string name;  // "walks_up"
  auto operator<=>(const LevelName&) const = default;
};

struct LevelEntry {
  PolicyKey key;
  std::vector<Rate> levels;    // as in LevelTable::levels; n = 0 where it was not run
  std::optional<int> reached;  // the last level up to which each was passed; none: not even the first
  double mean = 0.0;           // success over the levels that were run, each counting the same
};

struct LevelTable {
  Ladder ladder = kLadders.front();
  double level = 0.95;  // of intervals
  std::vector<LevelName> levels;
  std::vector<LevelEntry> entries;  // by engine, controller, arm, policy
};

// One for each ladder that has two levels or more. Throws InputError: rows of two suites or suite versions, two names
// of one level.
std::vector<LevelTable> level_tables(const std::vector<EpisodeRow>& rows, double level = 0.95);

// A table per ladder.
Analysis level_analysis(const std::vector<LevelTable>& tables);

}  // namespace duet
