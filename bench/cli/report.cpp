// duet report: tables, database and HTML from the rows of runs.
#include <fmt/format.h>

#include <filesystem>
#include <functional>

#include "bench/cli/command.h"
#include "bench/cli/tables.h"
#include "bench/parallel.h"
#include "bench/story.h"
#include "core/file.h"
#include "core/names.h"
#include "core/require.h"
#include "results/certificate.h"
#include "results/database.h"
#include "results/html_report.h"
#include "results/interval_plot.h"
#include "results/leaderboard.h"
#include "results/policy_report.h"

namespace duet::cli {
namespace {

struct ReportArguments {
  std::vector<std::string> runs, formats = {"md", "html"}, curves;
  std::string output;
  bool no_clips = false;
  int threads = default_threads();
};

std::vector<Run> load_runs(const std::vector<std::string>& paths) {
  std::vector<Run> runs;
  for (const std::string& path : paths) {
    runs.push_back(load_run(path));
    const RunInfo& first = runs.front().info;
    const RunInfo& info = runs.back().info;
    if (info.suite_hash != first.suite_hash) {
      throw InputError(fmt::format(
          "'{}' is a run of {} {} ({:.8}), '{}' of {} {} ({:.8}): results of different suites are not mixed",
          paths.front(), first.suite, first.suite_version, first.suite_hash, path, info.suite, info.suite_version,
          info.suite_hash));
    }
  }
  return runs;
}

std::vector<EpisodeRow> all_rows(const std::vector<Run>& runs) {
  std::vector<EpisodeRow> rows;
  for (const Run& run : runs) rows.insert(rows.end(), run.rows.begin(), run.rows.end());
  return rows;
}

void check_formats(const std::vector<std::string>& formats) {
  static const std::vector<std::string> known = {"md", "csv", "json", "tex", "html", "sqlite"};
  for (const std::string& format : formats)
    require(std::find(known.begin(), known.end(), format) != known.end(),
            unknown_name_message("format", format, known));
}

void write_format(const std::string& format, const std::string& path, const std::vector<Run>& runs,
                  const std::vector<LeaderboardEntry>& entries, const PolicyReport& policies,
                  const ReportArguments& arguments, Progress& progress) {
  if (format == "md") write_file(path, leaderboard_markdown(entries));
  if (format == "csv") write_file(path, leaderboard_csv(entries));
  if (format == "json") write_file(path, leaderboard_json(entries).dump(2) + "\n");
  if (format == "tex") write_file(path, leaderboard_latex(entries));
  if (format == "html") {
    ReportContent content = report_content(runs, !arguments.no_clips, arguments.curves, arguments.threads, progress);
    content.policies = policies;
    write_file(path, html_report(content));
  }
  if (format == "sqlite") write_database(all_rows(runs), path);
}

using Writer = std::function<void(const std::string& name, const std::string& text)>;

// What changes when only the engine does, and what the robot's contacts do to people, where there is anything to say.
void write_tables(const Tables& tables, const std::string& format, const Writer& write) {
  if (tables.has_engines()) {
    if (format == "md")
      write("engines.md", cross_engine_markdown(tables.engines) + "\n" +
                              certificate_markdown(tables.certificate, tables.engines.engines));
    if (format == "csv") write("engines.csv", cross_engine_csv(tables.engines));
    if (format == "json") write("engines.json", cross_engine_json(tables.engines).dump(2) + "\n");
    if (format == "tex") write("engines.tex", cross_engine_latex(tables.engines));
    if (format == "html") write("engines.svg", engine_plot_svg(tables.engines));
  }
  if (tables.has_controllers()) {
    if (format == "md") write("controllers.md", controller_table_markdown(tables.controllers));
    if (format == "csv") write("controllers.csv", controller_table_csv(tables.controllers));
    if (format == "json") write("controllers.json", controller_table_json(tables.controllers).dump(2) + "\n");
    if (format == "tex") write("controllers.tex", controller_table_latex(tables.controllers));
  }
  if (tables.has_contacts()) {
    if (format == "md") write("contacts.md", contact_table_markdown(tables.contacts));
    if (format == "csv") write("contacts.csv", contact_table_csv(tables.contacts));
    if (format == "json") write("contacts.json", contact_table_json(tables.contacts).dump(2) + "\n");
    if (format == "tex") write("contacts.tex", contact_table_latex(tables.contacts));
  }
}

void run_report(const Session& session, const ReportArguments& arguments) {
  check_formats(arguments.formats);
  const std::vector<Run> runs = load_runs(arguments.runs);
  const std::vector<EpisodeRow> rows = all_rows(runs);
  const Tables tables = make_tables(rows, runs.front().info.certificate);
  const PolicyReport policies = policy_report(rows);
  const std::filesystem::path folder = arguments.output.empty() ? arguments.runs.front() : arguments.output;
  Progress progress(session.progress());
  nlohmann::json json = {{"files", nlohmann::json::array()}};
  const auto wrote = [&](const std::string& path) {
    json["files"].push_back(path);
    note(session, "wrote " + path);
  };
  const Writer write = [&](const std::string& name, const std::string& text) {
    const std::string path = (folder / name).string();
    write_file(path, text);
    wrote(path);
  };
  for (const std::string& format : arguments.formats) {
    const std::string name = format == "html"     ? "report.html"
                             : format == "sqlite" ? "results.sqlite"
                                                  : "leaderboard." + format;
    const std::string path = (folder / name).string();
    write_format(format, path, runs, tables.leaderboard, policies, arguments, progress);
    wrote(path);
    write_tables(tables, format, write);
    for (const auto& [file, text] : policy_report_files(policies, format)) write(file, text);
  }
  add_tables(tables, json);
  add_policy_report(policies, json);
  print(session, tables_text(tables) + policy_report_text(policies), json);
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
  command->add_option("--curves", arguments->curves,
                      "training curves to show in the HTML (CSV; the first column is the axis)");
  command->add_flag("--no-clips", arguments->no_clips, "HTML without the clips' key frames and loss curves");
  command->add_option("-j,--threads", arguments->threads, "threads")->capture_default_str();
  command->callback([&session, arguments] { run_report(session, *arguments); });
}

}  // namespace duet::cli
