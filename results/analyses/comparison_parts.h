// The parts of a paired comparison: internal to the tables that compare episode by episode.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "duet/results/analyses/leaderboard.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/statistics/resolution.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {

// What is gathered of one comparison before its statistics are computed.
struct PairedRows {
  PairedTable table;
  std::vector<double> differences;  // success of A minus success of B, per pair
  std::vector<int> clusters;
  std::map<std::pair<std::string, std::string>, int> clips;  // (task, clip) -> cluster
  long unpaired_a = 0, unpaired_b = 0;

  void add(const EpisodeRow& a, const EpisodeRow& b);  // by their headline success
};

// Needs a pair; p_holm is left at 1.
Comparison evaluate(const std::string& name, const PairedRows& gathered, const LeaderboardOptions& options);

// Sets p_holm of all by Holm's step-down adjustment over them.
void correct_for_family(std::vector<Comparison>& comparisons);

// One line per comparison: pairs, success of both, difference with its intervals, tests, verdict.
TextTable comparison_table(const std::vector<Comparison>& comparisons, double margin = kFivePoints);

}  // namespace duet
