// All analyses of a run, in one list: files of every format, the text of a terminal and the sections of the HTML report
// are made from it. A new analysis is a function and a line in kAnalyses (run_analyses.cpp; docs/extending.md).
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/engines/cross_engine.h"
#include "duet/report/ranking/contact_table.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/report/ranking/ranking.h"
#include "duet/report/tables/analysis.h"

namespace duet {

// The caller's knowledge of metrics; the catalogue is not in this room.
struct RunMetrics {
  std::vector<MetricColumn> all;       // units
  std::vector<MetricColumn> drifting;  // those whose drift between engines is of interest
};

// The rows and tables that several analyses and the first screen are made of, computed once.
struct RunTables {
  std::vector<EpisodeRow> rows;
  RowFile file;  // of lean rows
  RunMetrics metrics;
  nlohmann::json certificate;  // parity certificate; null: none is attached
  std::vector<LeaderboardEntry> leaderboard;
  CrossEngine engines;
  Analysis contacts;
  Ranking board;
};
// Throws InputError: rows of two suites or suite versions, an episode that is there twice.
RunTables run_tables(std::vector<EpisodeRow> rows, RunMetrics metrics, const nlohmann::json& certificate,
                     RowFile file = {}, const RankingSuite& suite = {});

// The extent of the output: what ends a run, or all that `duet report` writes.
enum class Extent { kRun, kReport };

// The analyses that have a figure, in the order of the HTML report; of a run without episodes the leaderboard, which
// says so. For robots that walk by command, nothing that judges acts.
std::vector<Analysis> run_analyses(const RunTables& tables, Extent extent = Extent::kReport);

// The one of that name, whether or not it has a figure. Throws std::invalid_argument for an unknown name.
Analysis run_analysis(const RunTables& tables, std::string_view name);

// Names of all of them.
std::vector<std::string> run_analysis_names();

// Markdown for a terminal: the analyses, the board first. For robots that walk by command how they do, and no board.
std::string run_text(const std::vector<Analysis>& analyses);

// The screen that ends a run: verdict and board with the notes above them; run_text for robots that walk by command.
std::string run_screen(const RunTables& tables, const std::vector<Analysis>& analyses,
                       const std::vector<std::string>& notes);

// Success in each engine as an SVG that stands alone, for a README or a paper; the page of a report shows it, too.

// For each controller and policy a line per engine with its dot and interval, the mean over engines as a bar through
// them, on the shade of the mean's interval; playback hollow. Follows the reader's light or dark scheme. Only axes for
// fewer than two engines.
std::string engine_plot_svg(const CrossEngine& result);

}  // namespace duet
