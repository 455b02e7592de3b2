// Whether robots walk by command, how fast, and whether they fall: from rows of the task "walk", per perturbation,
// controller, command and engine. Nothing depends on the order of rows.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/statistics/statistics.h"

namespace duet {

// A metric of rows and how tables call it.
struct WalkFigure {
  std::string_view metric, title, unit;
  int decimals;
};
std::vector<WalkFigure> walk_figures();

struct WalkEntry {
  std::string perturbation, controller, command, engine;  // command: the row's clip
  long n = 0;                                             // episodes, without those that are unsupported
  long upright = 0;                                       // ended as planned
  Interval interval;                                      // Wilson, of upright over n
  long unsupported = 0;
  std::map<std::string, double, std::less<>> means;  // by metric, over the episodes that have it
};

struct WalkTable {
  double level = 0.95;
  std::vector<WalkEntry> entries;  // by perturbation (clean first), controller, command (as they come), engine
};

// Throws InputError: rows of two suites or suite versions.
WalkTable walk_table(const std::vector<EpisodeRow>& rows, double level = 0.95);

Analysis walk_analysis(const WalkTable& table);

}  // namespace duet
