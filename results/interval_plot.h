// Success with intervals as a small SVG that stands alone, for a README or a paper.
#pragma once

#include <string>
#include <vector>

#include "results/leaderboard.h"

namespace duet {

// One line per engine, controller, policy and perturbation for one task ("all": over all tasks): a dot with its
// interval and, where the null arm was run, a tick for it. Follows the reader's light or dark scheme.
std::string interval_plot_svg(const std::vector<LeaderboardEntry>& entries, const std::string& task = "all");

}  // namespace duet
