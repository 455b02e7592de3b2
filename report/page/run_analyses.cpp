#include "duet/report/page/run_analyses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "duet/archives/zip/zip.h"
#include "duet/core/named_table.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/ranking/policy_table.h"
#include "duet/report/studies/studies.h"
#include "duet/report/tables/line_plot.h"
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
    {kRankingName, [](const RunTables& run) { return ranking_analysis(run.board); }, Walking::kLeftOut, true},
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
    {"arena", [](const RunTables& run) { return arena_analysis(run.rows); }, Walking::kPrinted, true},
    {"walking", [](const RunTables& run) { return walk_analysis(run.rows); }, Walking::kPrinted, true},
};

bool has_walking(const RunTables& tables) {
  return std::ranges::any_of(tables.rows, [](const EpisodeRow& row) { return row.task == kWalkRows; });
}

}  // namespace

RunTables run_tables(std::vector<EpisodeRow> rows, RunMetrics metrics, const nlohmann::json& certificate, RowFile file,
                     const RankingSuite& suite) {
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
  tables.board = rank_policies(tables.rows, tables.contacts.estimates, suite);
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
  return entry_named(kAnalyses, "table", name).make(tables);
}

std::vector<std::string> run_analysis_names() { return names_of(kAnalyses); }

std::string run_text(const std::vector<Analysis>& analyses) {
  std::vector<std::string> parts;
  for (const Analysis& analysis : analyses)
    if (analysis.in_terminal) parts.push_back(terminal_text(analysis));
  return fmt::format("{}", fmt::join(parts, "\n"));
}

std::string run_screen(const RunTables& tables, const std::vector<Analysis>& analyses,
                       const std::vector<std::string>& notes) {
  if (!tables.rows.empty() && !has_walking(tables)) return ranking_screen(tables.board, notes);
  std::string text;
  for (const std::string& note : notes) text += "> " + note + "\n\n";
  return text + run_text(analyses);
}

namespace {

constexpr int kRowHeight = 26;
constexpr int kPlotWidth = 300;
constexpr int kTop = 30;

constexpr const char* kStyle = R"(<style>
text{font:13px system-ui,sans-serif;fill:#1d2024}.s{fill:#5b626b;font-size:11px}.g{stroke:#d5d8dc}
.b{stroke:#2a66a8;stroke-width:7;stroke-linecap:round;opacity:.35}.d{fill:#2a66a8}.n{stroke:#b4531b;stroke-width:2.5}
.c .b{stroke:#8a9099}.c .d{fill:#8a9099}
.m{stroke:#b4531b;stroke-width:3}.r{fill:#b4531b;opacity:.13}.h{fill:none;stroke:#8a9099;stroke-width:2}
.o .b{stroke:#8a9099}.t{font-weight:600}
@media(prefers-color-scheme:dark){text{fill:#e7e8ea}.s{fill:#a6adb6}.g{stroke:#3a4048}.b{stroke:#74aef0}.d{fill:#74aef0}
.n,.m{stroke:#f0965a}.r{fill:#f0965a}}
</style>)";

std::string axis(int left, int height) {
  std::string svg;
  for (int tick = 0; tick <= 100; tick += 25) {
    const int x = left + tick * kPlotWidth / 100;
    svg += fmt::format(R"(<line class="g" x1="{0}" x2="{0}" y1="{1}" y2="{2}"/>)", x, kTop - 6, height - 8);
    svg += fmt::format(R"(<text class="s" x="{}" y="{}" text-anchor="middle">{}{}</text>)", x, kTop - 12, tick,
                       tick == 100 ? " %" : "");
  }
  return svg;
}

double x_of(double fraction, int left) { return left + fraction * kPlotWidth; }

std::string dot_with_interval(double rate, const Interval& interval, const char* dot, int left, int y) {
  return fmt::format(
      R"(<line class="b" x1="{:.1f}" x2="{:.1f}" y1="{}" y2="{}"/><circle class="{}" cx="{:.1f}" cy="{}" r="4.5"/>)",
      x_of(interval.low, left), x_of(interval.high, left), y, y, dot, x_of(rate, left), y);
}

// No font metrics here: 7.2 px a character is a little more than the average of common fonts at 13 px.
int label_width(std::size_t characters) {
  return 24 + static_cast<int>(7.2 * static_cast<double>(std::max<std::size_t>(characters, 6)));
}

// Room for "mean 100.0 [100.0, 100.0]" beside the plot.
int rate_width(const char* before) { return 16 + label_width(std::string_view(before).size() + 20); }

// Lines of one combination: its name, its engines, playback.
int line_count(const EngineSuccess& success) {
  return 1 + static_cast<int>(success.engines.size()) + (success.playback.has_value() ? 1 : 0);
}

std::string engine_line(const EngineRate& rate, const char* group, const char* dot, int left, int y) {
  std::string svg = fmt::format(R"(<g class="{}"><text x="{}" y="{}" text-anchor="end">{}</text>)", group, left - 14,
                                y + 4, escape_html(rate.engine));
  if (rate.n > 0) svg += dot_with_interval(rate.rate, rate.interval, dot, left, y);
  return svg + fmt::format(R"(<text x="{}" y="{}">{}</text></g>)", left + kPlotWidth + 16, y + 4,
                           percent(rate.rate, rate.interval));
}

std::string mean_bar(const EngineSuccess& success, int left, int top, int bottom) {
  if (success.n == 0) return "";
  const double low = x_of(success.mean_interval.low, left);
  const double high = x_of(success.mean_interval.high, left);
  return fmt::format(
      R"(<rect class="r" x="{0:.1f}" y="{1}" width="{2:.1f}" height="{3}"/><line class="m" x1="{4:.1f}" x2="{4:.1f}" y1="{1}" y2="{5}"/>)",
      low, top, high - low, bottom - top, x_of(success.mean, left), bottom);
}

std::string combination_block(const EngineSuccess& success, const std::string& label, int left, int top) {
  const int engines = static_cast<int>(success.engines.size());
  const int first = top + kRowHeight + kRowHeight / 2;
  std::string svg = fmt::format(R"(<text class="t" x="{}" y="{}" text-anchor="end">{}</text>)", left - 14,
                                top + kRowHeight / 2 + 4, escape_html(label));
  svg += fmt::format(R"(<text x="{}" y="{}">mean {}</text>)", left + kPlotWidth + 16, top + kRowHeight / 2 + 4,
                     percent(success.mean, success.mean_interval));
  svg += mean_bar(success, left, top + 4, top + kRowHeight * (1 + engines) - 4);
  for (int i = 0; i < engines; ++i) {
    svg += engine_line(success.engines[i], "e", "d", left, first + kRowHeight * i);
  }
  if (success.playback.has_value()) {
    svg += engine_line(*success.playback, "o", "h", left, first + kRowHeight * engines);
  }
  return svg;
}

struct Drawing {
  int width = 0, height = 0;
  std::string body;
};

Drawing engine_drawing(const CrossEngine& result) {
  const RowLabels labels = combination_labels(result.success);
  std::vector<std::string> names;
  std::size_t longest = 0;
  for (const std::vector<std::string>& cells : labels.cells) {
    names.push_back(fmt::format("{}", fmt::join(cells, " / ")));
    longest = std::max(longest, names.back().size());
  }
  for (const RunEngine& engine : result.engines) longest = std::max(longest, engine.name.size());
  longest += longest / 6;  // combinations are set bold
  const int left = label_width(std::max(longest, kPlaybackEngine.size()));
  Drawing drawing{.width = left + kPlotWidth + rate_width("mean "), .height = kTop + 8, .body = ""};
  std::string blocks;
  for (std::size_t i = 0; i < result.success.size(); ++i) {
    blocks += combination_block(result.success[i], names[i], left, drawing.height - 8);
    drawing.height += kRowHeight * line_count(result.success[i]) + 6;
  }
  drawing.body = axis(left, drawing.height) + blocks;
  return drawing;
}

constexpr const char* kEnginePlotLabel = "Success per engine with intervals, and the mean over engines";

}  // namespace

std::string engine_plot_svg(const CrossEngine& result) {
  const Drawing drawing = engine_drawing(result);
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" role="img" aria-label="{2}">{3}{4}</svg>)"
      "\n",
      drawing.width, drawing.height, kEnginePlotLabel, kStyle, drawing.body);
}

}  // namespace duet
