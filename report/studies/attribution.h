// Why two settings of an engine differ: the same episodes in every cell of a full factorial of switches between them.
// What each switch does alone, what switches do only together, each one's Shapley share of the gap, for success and for
// falls; and how much of the gap, on clips that were not looked at, the switches make that were found on the others.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"
#include "duet/statistics/factorial.h"

namespace duet {

struct AttributionRows {
  std::vector<std::string> switches;           // names
  std::vector<std::string> settings;           // what each turns: "dt 0.002 -> 0.001"
  std::vector<std::string> cell_names;         // of each cell (statistics/factorial.h): "from", "law", ..., "to"
  std::vector<std::vector<EpisodeRow>> cells;  // an engine that takes another one's place bears its name
};

struct AttributionOptions : IntervalOptions {
  double holdout = 0.5;  // share of the clips that are held out; 0: none
};

// A set of switches is sufficient where it alone leaves at most this share of the gap.
inline constexpr double kGapLeft = 0.05;

// Per engine, controller, policy and perturbation, over the episodes that every cell has. Throws InputError where there
// is none, and as rows_of_policies.
Analysis attribution_analysis(const AttributionRows& rows, const AttributionOptions& options = {});

// The way from the one setting to the other, as bars of text: where it starts, a bar for each effect from where the one
// before ended, and where it ends.
std::string attribution_bars(const Analysis& analysis);
// The same as an SVG that stands alone, with intervals; success beside falls.
std::string attribution_svg(const Analysis& analysis);

}  // namespace duet
