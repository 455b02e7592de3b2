// Policies beside others, without perturbation: success under the headline detector and as the paper's detectors see
// it, the lift over the null arm, falls, contact limits and jerk, per engine and over physics engines ("playback"
// stands apart and is in no mean); by task, with the supplement's Table S9 beside it; every policy against every other
// episode by episode. Nothing depends on the order of rows.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/report/tables/analysis.h"

namespace duet {

// A column per figure for one engine, a table per figure for several; by task with the paper's rows; policies in pairs.
// Nothing but a note where the only policy is `replay`, which decides nothing. `entries`: leaderboard of the rows with
// the same options. Throws InputError as leaderboard() does.
Analysis policy_analysis(const std::vector<EpisodeRow>& rows, const std::vector<LeaderboardEntry>& entries,
                         const IntervalOptions& options = {});

struct PaperTaskRate {
  Task task;
  double percent;
};
// A row of Table S9 as the supplement prints it, in %: overall, then by task.
struct PaperPolicy {
  std::string_view name, family;  // family and size of the perturbation, "" for none
  double size;                    // [m] or a probability
  double overall;
  std::array<PaperTaskRate, kPaperTasks.size()> tasks;
};
std::span<const PaperPolicy> paper_policies();
std::string paper_detector_sentence();  // why only one column can be held against it

}  // namespace duet
