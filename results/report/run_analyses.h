// All analyses of a run, in one list: files of every format, the text of a terminal and the sections of the HTML report
// are made from it. A new analysis is a function and a line in kAnalyses (run_analyses.cpp; docs/adding-a-table.md).
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "duet/results/analyses/analysis.h"
#include "duet/results/analyses/board.h"
#include "duet/results/analyses/contact_table.h"
#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/leaderboard.h"

namespace duet {

// What the caller knows of metrics; the catalogue is not in this room.
struct RunMetrics {
  std::vector<MetricColumn> all;       // units
  std::vector<MetricColumn> drifting;  // those whose drift between engines is of interest
};

// What several analyses and the first screen are made of, computed once.
struct RunTables {
  std::vector<EpisodeRow> rows;
  RowFile file;  // of lean rows
  RunMetrics metrics;
  nlohmann::json certificate;  // parity certificate; null: none is attached
  std::vector<LeaderboardEntry> leaderboard;
  CrossEngine engines;
  ContactTable contacts;
  Board board;
};
// Throws InputError: rows of two suites or suite versions, an episode that is there twice.
RunTables run_tables(std::vector<EpisodeRow> rows, RunMetrics metrics, const nlohmann::json& certificate,
                     RowFile file = {}, const BoardSuite& suite = {});

// What ends a run, or all that `duet report` writes.
enum class Extent { kRun, kReport };

// Those that have a figure, in the order of the HTML report; of a run without episodes the leaderboard, which says so.
// Of robots that walk by command nothing that judges acts.
std::vector<Analysis> run_analyses(const RunTables& tables, Extent extent = Extent::kReport);

// The one of that name, whether or not it has a figure. Throws std::invalid_argument for an unknown name.
Analysis run_analysis(const RunTables& tables, std::string_view name);

// Names of all of them.
std::vector<std::string> run_analysis_names();

// Markdown for a terminal: the analyses, the board first. Of robots that walk by command how they do, and no board.
std::string run_text(const std::vector<Analysis>& analyses);

// What ends a run: verdict and board on one screen with the notes above them; of robots that walk run_text.
std::string run_screen(const RunTables& tables, const std::vector<Analysis>& analyses,
                       const std::vector<std::string>& notes);

}  // namespace duet
