// The parts of a paired comparison: internal to the tables that compare episode by episode.
#pragma once

#include <string>
#include <vector>

#include "duet/report/ranking/leaderboard.h"
#include "duet/report/ranking/resolution.h"
#include "duet/report/tables/text_table.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {

// The rows of one comparison, gathered before its statistics are computed.
struct PairedRows {
  EpisodePairs pairs;
  long unpaired_a = 0, unpaired_b = 0;
};

// Which p is which.
inline constexpr const char* kPairedTests =
    "p: exact test of the clips' signs, as on the board (all episodes of a clip are one observation; where each clip "
    "has "
    "one pair it is McNemar's). McNemar p: over episodes, for comparison with others' tables; too small where clips "
    "repeat.";

// Needs a pair; p_holm is left at 1, and so are the names.
Comparison evaluate(const PairedRows& gathered, const IntervalOptions& options);

// Sets p_holm of all by Holm's step-down adjustment over them.
void correct_for_family(std::vector<Comparison>& comparisons);

// One line per comparison: pairs, success of both, difference with its intervals, tests, verdict. Without title.
TitledTable comparison_table(const std::vector<Comparison>& comparisons, double margin = kFivePoints);

void add_comparison_figures(const Comparison& comparison, double margin, std::vector<Figure>& into);

}  // namespace duet
