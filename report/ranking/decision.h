// Which of two policies is better, from the rows of a run that may stop before its end: the clips in a fixed order of
// rounds, one observation per clip, an anytime-valid test (statistics/sequential_test.h) after each look. The
// same rows of the same rounds give the same decision, whatever else is in the folder and in which order it came.
//
// One observation is one clip of one task: success of A minus success of B, first over the clip's distinct episodes in
// one engine, controller and perturbation, then over those, each counting the same. Episodes of one clip resemble each
// other, and those of several engines still more: they are no independent pairs. Tasks are the strata.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "duet/rows/episode_row.h"
#include "duet/statistics/sequential_test.h"

namespace duet {

using TaskClip = std::pair<std::string, std::string>;  // task, clip

struct DecisionOptions {
  std::vector<std::string> policies;  // the first against each of the others
  double alpha = 0.05;                // of all pairs together: divided by their number (Bonferroni)
  double min_effect = 0.05;           // the margin within which two policies are the same

  [[nodiscard]] bool asked() const { return !policies.empty(); }
};
// Throws std::invalid_argument: fewer than two policies, one twice, alpha or min_effect not in (0, 1).
void check_decision(const DecisionOptions& options);

// Clips in an order that `seed` permutes within each task, dealt to rounds: every round has a clip of every task, tasks
// with more clips give several to a round. There are as many rounds as the smallest task has clips.
std::vector<std::vector<TaskClip>> decision_rounds(const std::vector<TaskClip>& clips, std::uint64_t seed);

struct PairDecision {
  std::string a, b;
  SequentialDecision verdict = SequentialDecision::kUndecided;
  long rounds = 0, clips = 0;     // that it took, or that there were
  long better = 0, worse = 0;     // clips in which A succeeds more often, or B
  double difference = 0.0;        // A minus B, mean over clips; NaN without one
  Interval interval = {};         // at 1 - alpha of this pair, valid at all looks at once
  double e_value = 1.0, p = 1.0;  // p: anytime-valid
};

struct Decision {
  DecisionOptions options;
  std::vector<PairDecision> pairs;
  [[nodiscard]] bool is_decided() const;
  [[nodiscard]] bool is_open(const std::string& policy) const;  // whether more episodes of it are of use
};

// Looks after the numbers of rounds in `looks` (rising); a pair keeps the figures of the look that decided it. Rows of
// other clips, policies and arms, those that could not run, and playback beside physics engines are left out. Throws as
// require_one_suite.
Decision decide(const std::vector<EpisodeRow>& rows, const std::vector<std::vector<TaskClip>>& rounds,
                const std::vector<long>& looks, const DecisionOptions& options);

// "dstar is better than dp: +6.3 points [1.2, 11.4] ..." per pair.
std::string decision_text(const Decision& decision);
nlohmann::json decision_json(const Decision& decision);  // duet.decision/1

}  // namespace duet
