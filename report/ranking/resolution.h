// The differences that a run was large enough to tell: verdict words for tests on a fixed number of pairs, and how many
// episodes a claimed difference needs.
#pragma once

#include <string>
#include <vector>

#include "duet/report/ranking/leaderboard.h"
#include "duet/statistics/sequential_test.h"

namespace duet {

inline constexpr double kFivePoints = 0.05;  // the margin where nobody names one

// The same where the interval by clip lies inside (-margin, margin); else better or worse where p (Holm) is at most
// 1 - level; else undecided.
PairVerdict verdict_of(const Comparison& comparison, double margin);
// The same of a difference that another test has judged, with that test's interval.
PairVerdict verdict_of(double difference, const Interval& interval, double p_holm, double level, double margin);

// The smallest number of pairs, or of episodes per arm, that shows the difference in 80 % of runs. difference in (0,
// 1); throws std::invalid_argument.
long needed_pairs(double discordance, double difference, double alpha = 0.05);
long needed_episodes(double rate, double difference, double alpha = 0.05);

// A sentence for the undecided comparisons that are too small for the margin, with the pairs that they need; none where
// none is.
std::vector<std::string> resolution_notes(const std::vector<Comparison>& comparisons, double margin);
// The same for arms over all tasks, unpaired: with the episodes that they need.
std::vector<std::string> resolution_notes(const std::vector<LeaderboardEntry>& entries, double margin);

// `margin`: of the verdicts.
Analysis comparison_analysis(const std::vector<Comparison>& comparisons, double margin = kFivePoints);

}  // namespace duet
