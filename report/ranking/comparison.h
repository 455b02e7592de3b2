// Two arms on the same episodes: success of A less success of B, with intervals, tests and a verdict; what so many
// episodes can tell at all. Comparisons are estimates that follow one another, in the order of add_comparison.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/report/ranking/leaderboard.h"
#include "duet/report/tables/analysis.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/statistics/sequential_test.h"

namespace duet {

inline constexpr double kFivePoints = 0.05;  // the margin where nobody names one

// Pairs rows of the main arm by task, clip, episode and the group fields they share; per task and over all. Where A and
// B have one value each of engine, controller, policy or perturbation and the values differ, that is what is compared
// ("mujoco/vmc/replay vs null hug"). `margin`: of the verdicts. Throws InputError where nothing pairs (it says what
// differs), for rows of two suite versions and for an episode that is there twice.
Analysis comparison_analysis(const std::vector<EpisodeRow>& a, const std::vector<EpisodeRow>& b,
                             const IntervalOptions& options = {}, double margin = kFivePoints);

// The rows of one comparison, gathered before its statistics are computed.
struct PairedRows {
  EpisodePairs pairs;
  long unpaired_a = 0, unpaired_b = 0;  // episodes of the group that the other run lacks; left out
};

// Which p is which.
inline constexpr const char* kPairedTests =
    "p: exact test of the clips' signs, as on the board (all episodes of a clip are one observation; where each clip "
    "has "
    "one pair it is McNemar's). McNemar p: over episodes, for comparison with others' tables; too small where clips "
    "repeat.";

// Needs a pair. Intervals of the difference: paired Newcombe; by clip a bootstrap, nowhere narrower than
// newcombe_by_clip. p: sign_flip_exact by clip; of episodes exact McNemar. p_holm and the verdict are left open.
void add_comparison(const PairedRows& gathered, const IntervalOptions& options, const EstimatesOf& of);
// Sets p_holm of all comparisons that have a p by Holm's adjustment over them, and every verdict: the same where the
// interval of the estimate `difference` lies inside (-margin, margin); else better or worse where p_holm is at most 1 -
// level; else, and without a p, undecided.
void judge_family(std::string_view difference, double level, double margin, Estimates& comparisons);
SequentialDecision verdict_of(double difference, const Interval& interval, double p_holm, double level, double margin);
// A line per comparison, called as `title` says.
Pivot comparison_pivot(std::string (*title)(const Estimate& keys));

// The smallest number of pairs, or of episodes per arm, that shows the difference in 80 % of runs. difference in (0,
// 1); throws std::invalid_argument.
long needed_pairs(double discordance, double difference, double alpha = 0.05);
long needed_episodes(double rate, double difference, double alpha = 0.05);

// A sentence for the undecided comparisons that are too small for the margin, with the pairs that they need; none where
// none is.
std::vector<std::string> resolution_notes(const Estimates& comparisons, double level, double margin);
// The same for arms over all tasks, unpaired: with the episodes that they need.
std::vector<std::string> resolution_notes(const std::vector<LeaderboardEntry>& entries, double margin);

}  // namespace duet
