// duet report: tables, database and HTML from the rows of runs.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <utility>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file_batch.h"
#include "duet/core/machine.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/execution/report_content.h"
#include "duet/replay/replay_page.h"
#include "duet/report/page/html_report.h"
#include "duet/report/page/run_analyses.h"
#include "duet/report/ranking/comparison.h"
#include "duet/rows/groups/database.h"
#include "duet/rows/merge/row_merge.h"

namespace duet::cli {
namespace {

struct ReportArguments {
  std::vector<std::string> runs, formats = {"md", "html"}, curves, columns;
  std::string output;
  bool no_clips = false;
  ReplayChoice replays{.episodes = {},
                       .engines = {},
                       .controllers = {},
                       .policies = {},
                       .perturbations = {},
                       .tasks = {},
                       .scenes = 0,
                       .run_again = false,
                       .allow_programs = false,
                       .card = {},
                       .threads = 1};
  double min_effect = 0.0;  // [points]; 0: none is claimed
  int threads = default_threads();
};

// Rows of one run for tables are held lean; what looks at rows themselves needs them whole, and so do rows that are
// held against those of another run.
RowExtent extent_of(const ReportArguments& arguments) {
  const bool database = std::ranges::find(arguments.formats, "sqlite") != arguments.formats.end();
  const bool whole = database || arguments.replays.scenes > 0 || arguments.runs.size() > 1;
  return whole ? RowExtent::kWhole : RowExtent::kLean;
}

std::vector<Run> load_runs(const ReportArguments& arguments) {
  std::vector<Run> runs;
  for (const std::string& path : arguments.runs) {
    if (std::filesystem::is_regular_file(path))
      throw InputError(fmt::format(
          "'{}': expected the folder of a run, found a file; `duet score` judges recordings and motions", path));
    runs.push_back(open_run(path, extent_of(arguments)));
  }
  return runs;
}

void check_formats(const std::vector<std::string>& formats) {
  static const std::vector<std::string> known = {"md", "csv", "json", "tex", "html", "sqlite"};
  for (const std::string& format : formats) require_known("format", format, known);
}

// The columns asked for, of the tables that LaTeX gets. Throws where no table has one of them.
std::vector<Analysis> with_columns_of_latex(std::vector<Analysis> analyses, const std::vector<std::string>& columns) {
  std::vector<std::string> known;
  for (Analysis& analysis : analyses)
    for (TitledTable& titled : analysis.tables) {
      const std::vector<std::string>& header = titled.table.header;
      for (std::size_t i = titled.table.label_columns; i < header.size(); ++i)
        if (std::ranges::find(known, header[i]) == known.end()) known.push_back(header[i]);
      if (!columns.empty()) titled = with_columns(std::move(titled), columns);
    }
  for (const std::string& column : columns) require_known("column", column, known);
  return analyses;
}

// Writes a file of a format into the folder, with what has to be said of the runs.
using Writer = std::function<void(const std::string& name, const std::string& text, const std::string& format)>;

// Pages beside the report; a viewer that is not there is named, and the report does without them.
std::vector<ReportReplay> replays_of(const Run& run, const ReportArguments& arguments, const Writer& write,
                                     std::vector<std::string>& notes, Progress& progress) {
  if (arguments.replays.scenes == 0) return {};
  if (arguments.runs.size() > 1) {
    notes.emplace_back("Replays are made of one run; this report is of several (duet replay RUN).");
    return {};
  }
  try {
    ReplayChoice choice = arguments.replays;
    choice.threads = arguments.threads;
    return report_replays(
        run, choice, load_viewer(),
        [&](const std::string& name, const std::string& text) { write(name, text, "html"); }, progress);
  } catch (const MissingError& error) {
    notes.push_back(fmt::format("There are no replays: {}.", error.what()));
    return {};
  }
}

// The run without its rows, which the tables have.
std::string html_text(const Run& run, const RunTables& tables, const std::vector<Analysis>& analyses,
                      const std::vector<std::string>& notes, std::vector<ReportReplay> replays,
                      const ReportArguments& arguments, Progress& progress) {
  ReportContent content = report_content(run, tables, analyses, std::move(replays), !arguments.no_clips,
                                         arguments.curves, arguments.threads, progress);
  content.notes.insert(content.notes.begin(), notes.begin(), notes.end());
  const ViewerBundle viewer = viewer_or_plain("report", content.notes);
  return html_report(content, viewer);
}

void run_report(const Session& session, const ReportArguments& arguments) {
  check_formats(arguments.formats);
  std::vector<Run> runs = load_runs(arguments);
  std::vector<std::string> notes = completeness_notes(arguments.runs, runs);
  Run run = united(std::move(runs));
  add_row_notes(run.rows, notes);
  const bool replays = arguments.replays.scenes > 0;
  const RunTables tables = tables_of(replays ? run.rows : std::exchange(run.rows, {}), run);
  const std::vector<Analysis> analyses = run_analyses(tables),
                              latex = with_columns_of_latex(analyses, arguments.columns);
  const std::string folder = arguments.output.empty() ? arguments.runs.front() : arguments.output;
  notes = with_suite(tables.board.suite, std::move(notes));
  if (arguments.min_effect > 0.0)
    for (std::string& caution : resolution_notes(tables.leaderboard, arguments.min_effect / 100.0))
      notes.push_back(std::move(caution));
  Progress progress(session.progress());
  nlohmann::json json = {{"files", nlohmann::json::array()}, {"notes", notes}};
  const auto wrote = [&](const std::string& path) {
    json["files"].push_back(path);
    note(session, "wrote " + path);
  };
  FileBatch batch;  // a disk that fills up leaves no new table among old ones
  std::vector<std::string> written;
  const Writer write = [&](const std::string& name, const std::string& text, const std::string& format) {
    written.push_back(join_without_links(folder, name));
    batch.write(written.back(), format == "html" ? text : with_notes(format, text, notes));
  };
  for (const std::string& format : arguments.formats) {
    if (format == "html") {
      std::vector<std::string> own = notes;
      std::vector<ReportReplay> replays = replays_of(run, arguments, write, own, progress);
      write("report.html", html_text(run, tables, analyses, own, std::move(replays), arguments, progress), format);
      if (tables.engines.engines.size() > 1) write("engines.svg", engine_plot_svg(tables.engines), "svg");
    }
    for (const auto& [file, text] : analysis_files(format == "tex" ? latex : analyses, format))
      write(file, text, format);
  }
  if (std::ranges::find(arguments.formats, "sqlite") != arguments.formats.end()) {  // the last that may find no room
    written.push_back(join_without_links(folder, "results.sqlite"));
    write_database(tables.rows, written.back(), notes);
  }
  batch.put_in_place();
  for (const std::string& path : written) wrote(path);
  add_analyses(analyses, json);
  print(session, with_notes("md", run_text(analyses), notes), json);
  if (arguments.replays.scenes == 0)
    suggest_next(session, fmt::format("duet replay {} -o {}", shell_word(arguments.runs.front()),
                                      shell_word(folder + "/replay.html")));
}

}  // namespace

void add_report(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "report", "tables, SQLite and HTML from the rows of runs of one suite",
                                  "duet report runs/core --format md,csv,html --output paper");
  auto arguments = std::make_shared<ReportArguments>();
  command->add_option("runs", arguments->runs, "run directories")->required();
  command->add_option("-f,--format", arguments->formats, "md, csv, json, tex, html, sqlite (default: md,html)")
      ->delimiter(',');
  command->add_option("-o,--output", arguments->output, "folder (default: the first run directory)");
  command
      ->add_option("--columns", arguments->columns,
                   "columns of the LaTeX tables, beside what tells their rows apart; a table without any stays whole")
      ->delimiter(',');
  command->add_option("--curves", arguments->curves,
                      "training curves to show in the HTML (CSV; the first column is the axis)");
  command
      ->add_option("--min-effect", arguments->min_effect,
                   "a difference that is claimed [points]: says which arms are too small for it, and what they need")
      ->check(CLI::Range(0.1, 99.0));
  command
      ->add_option(
          "--replays", arguments->replays.scenes,
          "clips to show in 3-D, where engines and policies agree least (`duet replay`); runs them again where "
          "the run has kept no recording")
      ->check(CLI::Range(1, 1000));
  command->add_flag("--no-clips", arguments->no_clips, "HTML without the clips' key frames and loss curves");
  add_threads(command, arguments->threads);
  add_allow_programs(*command, arguments->replays.allow_programs);
  command->callback([&session, arguments] { run_report(session, *arguments); });
}

}  // namespace duet::cli
