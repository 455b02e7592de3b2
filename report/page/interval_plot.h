// Success with intervals as a small SVG that stands alone, for a README or a paper.
#pragma once

#include <string>
#include <vector>

#include "duet/report/engines/cross_engine.h"
#include "duet/report/ranking/leaderboard.h"

namespace duet {

// One line per engine, controller, policy and perturbation for one task ("all": over all tasks): a dot with its
// interval and, where the null arm was run, a tick for it. Follows the reader's light or dark scheme.
std::string interval_plot_svg(const std::vector<LeaderboardEntry>& entries, const std::string& task = "all");

// Success per engine: for each controller and policy a line per engine with its dot and interval, the mean over engines
// as a bar through them, on the shade of the mean's interval; playback hollow. Only axes for fewer than two engines.
std::string engine_plot_svg(const CrossEngine& result);

}  // namespace duet
