// Comparison of physics engines: success, ranks, metrics against kinematic playback, when states part
// and contact forces. From the rows of one arm; "playback" is no physics engine, it is shown apart and is in no mean.
// Nothing depends on the order of rows (docs/reading-the-leaderboard.md, "Across engines").
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/report/engines/cross_engine_result.h"
#include "duet/report/tables/analysis.h"
#include "duet/report/tables/metric_column.h"
#include "duet/rows/episode_row.h"

namespace duet {

// `metrics`: those whose drift is of interest (the 18 of retargeting). Throws InputError: rows of two suites or suite
// versions, an episode that is there twice.
CrossEngine cross_engine(const std::vector<EpisodeRow>& rows, const std::vector<MetricColumn>& metrics,
                         const CrossEngineOptions& options = {});

// Nothing but a note for fewer than two physics engines. The parity certificate (null: none is attached) is its last
// table, of one engine too.
Analysis engine_analysis(const CrossEngine& result, const nlohmann::json& certificate = nullptr);

// Labels of all entries in turn: "Controller" and "Perturbation" as far as they differ, and "Policy".
RowLabels combination_labels(const std::vector<EngineSuccess>& success);

// Unit of a force by the ending of its name: "N", "N s", "s", "N/cm^2", "" for another.
std::string force_unit(std::string_view name);

}  // namespace duet
