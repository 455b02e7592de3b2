#include "duet/report/page/run_analyses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/archives/zip/deflate.h"
#include "duet/core/names.h"
#include "duet/report/page/engine_plot.h"
#include "duet/report/page/foot_plots.h"
#include "duet/report/ranking/policy_table.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

Analysis engines_with_plot(const RunTables& tables) {
  Analysis analysis = engine_analysis(tables.engines, tables.certificate);
  if (tables.engines.engines.size() > 1)
    analysis.drawing = fmt::format(
        "<figure><img src=\"data:image/svg+xml;base64,{}\" alt=\"Success per engine with intervals, and the mean over "
        "engines\"><figcaption>Dots: success in each engine with its interval; bar: the mean over engines, on the "
        "shade of its interval.</figcaption></figure>\n",
        base64(engine_plot_svg(tables.engines)));
  return analysis;
}

Analysis controllers_with_steps(const RunTables& tables) {
  Analysis analysis = controller_analysis(tables.rows);
  analysis.plots = {
      {.title = "Steps",
       .note = "The lowest point of each sole over the ground, one episode of each controller that walks.",
       .plots = foot_plots(tables.rows, tables.file)}};
  return analysis;
}

// The use of an analysis where robots walk by command.
enum class Walking { kPrinted, kWritten, kLeftOut };

struct ListedAnalysis {
  std::string_view name;
  Analysis (*make)(const RunTables& tables);
  Walking walking;
  bool after_run;  // printed at the end of a run, too
};

constexpr ListedAnalysis kAnalyses[] = {
    {kBoardName, [](const RunTables& run) { return board_analysis(run.board); }, Walking::kLeftOut, true},
    {"leaderboard", [](const RunTables& run) { return leaderboard_analysis(run.leaderboard, run.metrics.all); },
     Walking::kWritten, true},
    {"interaction", [](const RunTables& run) { return interaction_analysis(run.rows); }, Walking::kLeftOut, true},
    {"engines", engines_with_plot, Walking::kWritten, true},
    {"controllers", controllers_with_steps, Walking::kWritten, true},
    {"policies", [](const RunTables& run) { return policy_analysis(run.rows, run.leaderboard); }, Walking::kLeftOut,
     false},
    {"degradation", [](const RunTables& run) { return degradation_analysis(run.rows); }, Walking::kLeftOut, false},
    {"reactivity", [](const RunTables& run) { return reactivity_analysis(run.rows); }, Walking::kLeftOut, false},
    {"contacts", [](const RunTables& run) { return run.contacts; }, Walking::kWritten, true},
    {"people", [](const RunTables& run) { return people_analysis(run.rows); }, Walking::kWritten, true},
    {"trainings", [](const RunTables& run) { return training_analysis(run.rows); }, Walking::kLeftOut, true},
    {"levels", [](const RunTables& run) { return level_analysis(run.rows); }, Walking::kPrinted, true},
    {"walking", [](const RunTables& run) { return walk_analysis(run.rows); }, Walking::kPrinted, true},
};

bool has_walking(const RunTables& tables) {
  return std::ranges::any_of(tables.rows, [](const EpisodeRow& row) { return row.task == kWalkRows; });
}

}  // namespace

RunTables run_tables(std::vector<EpisodeRow> rows, RunMetrics metrics, const nlohmann::json& certificate, RowFile file,
                     const BoardSuite& suite) {
  RunTables tables{.rows = std::move(rows),
                   .file = std::move(file),
                   .metrics = std::move(metrics),
                   .certificate = certificate,
                   .leaderboard = {},
                   .engines = {},
                   .contacts = {},
                   .board = {}};
  tables.leaderboard = leaderboard(tables.rows);
  tables.engines = cross_engine(tables.rows, tables.metrics.drifting, {.file = tables.file});
  tables.contacts = contact_analysis(tables.rows);
  tables.board = board(tables.rows, tables.contacts.estimates, suite);
  return tables;
}

std::vector<Analysis> run_analyses(const RunTables& tables, Extent extent) {
  const bool walking = has_walking(tables);
  if (tables.rows.empty()) return {run_analysis(tables, kLeaderboardName)};
  std::vector<Analysis> analyses;
  for (const ListedAnalysis& listed : kAnalyses) {
    if ((extent == Extent::kRun && !listed.after_run) || (walking && listed.walking == Walking::kLeftOut)) continue;
    Analysis analysis = listed.make(tables);
    analysis.in_terminal = !walking || listed.walking == Walking::kPrinted;
    if (!analysis.empty()) analyses.push_back(std::move(analysis));
  }
  return analyses;
}

Analysis run_analysis(const RunTables& tables, std::string_view name) {
  for (const ListedAnalysis& listed : kAnalyses)
    if (listed.name == name) return listed.make(tables);
  throw std::invalid_argument(unknown_name_message("table", std::string(name), run_analysis_names()));
}

std::vector<std::string> run_analysis_names() {
  std::vector<std::string> names;
  for (const ListedAnalysis& listed : kAnalyses) names.emplace_back(listed.name);
  return names;
}

std::string run_text(const std::vector<Analysis>& analyses) {
  std::vector<std::string> parts;
  for (const Analysis& analysis : analyses)
    if (analysis.in_terminal) parts.push_back(terminal_text(analysis));
  return fmt::format("{}", fmt::join(parts, "\n"));
}

std::string run_screen(const RunTables& tables, const std::vector<Analysis>& analyses,
                       const std::vector<std::string>& notes) {
  if (!tables.rows.empty() && !has_walking(tables)) return board_screen(tables.board, notes);
  std::string text;
  for (const std::string& note : notes) text += "> " + note + "\n\n";
  return text + run_text(analyses);
}

}  // namespace duet
