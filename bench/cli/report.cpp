// duet report: tables, database and HTML from the rows of runs.
#include <fmt/format.h>

#include <filesystem>

#include "bench/cli/command.h"
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

namespace duet::cli {
namespace {

struct ReportArguments {
  std::vector<std::string> runs, formats = {"md", "html"};
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
                  const std::vector<LeaderboardEntry>& entries, const ReportArguments& arguments, Progress& progress) {
  if (format == "md") write_file(path, leaderboard_markdown(entries));
  if (format == "csv") write_file(path, leaderboard_csv(entries));
  if (format == "json") write_file(path, leaderboard_json(entries).dump(2) + "\n");
  if (format == "tex") write_file(path, leaderboard_latex(entries));
  if (format == "html")
    write_file(path, html_report(report_content(runs, !arguments.no_clips, arguments.threads, progress)));
  if (format == "sqlite") write_database(all_rows(runs), path);
}

// engines.md and the like, and engines.svg: what changes when only the engine does.
void write_engines(const CrossEngine& engines, const nlohmann::json& certificate, const std::string& folder,
                   const std::vector<std::string>& formats, nlohmann::json& written) {
  const auto write = [&](const std::string& name, const std::string& text) {
    const std::string path = (std::filesystem::path(folder) / name).string();
    write_file(path, text);
    written.push_back(path);
  };
  for (const std::string& format : formats) {
    if (format == "md")
      write("engines.md", cross_engine_markdown(engines) + "\n" + certificate_markdown(certificate, engines.engines));
    if (format == "csv") write("engines.csv", cross_engine_csv(engines));
    if (format == "json") write("engines.json", cross_engine_json(engines).dump(2) + "\n");
    if (format == "tex") write("engines.tex", cross_engine_latex(engines));
  }
  write("engines.svg", engine_plot_svg(engines));
}

void run_report(const Session& session, const ReportArguments& arguments) {
  check_formats(arguments.formats);
  const std::vector<Run> runs = load_runs(arguments.runs);
  const std::vector<LeaderboardEntry> entries = leaderboard(all_rows(runs));
  const std::filesystem::path folder = arguments.output.empty() ? arguments.runs.front() : arguments.output;
  Progress progress(session.progress());
  nlohmann::json written = nlohmann::json::array();
  for (const std::string& format : arguments.formats) {
    const std::string name = format == "html"     ? "report.html"
                             : format == "sqlite" ? "results.sqlite"
                                                  : "leaderboard." + format;
    const std::string path = (folder / name).string();
    write_format(format, path, runs, entries, arguments, progress);
    written.push_back(path);
    note(session, "wrote " + path);
  }
  const CrossEngine engines = across_engines(all_rows(runs));
  const nlohmann::json& certificate = runs.front().info.certificate;
  if (engines.engines.size() > 1) write_engines(engines, certificate, folder.string(), arguments.formats, written);
  print(session,
        leaderboard_markdown(entries) + "\n" + cross_engine_markdown(engines) + "\n" +
            certificate_markdown(certificate, engines.engines),
        {{"files", written}, {"leaderboard", leaderboard_json(entries)}, {"engines", cross_engine_json(engines)}});
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
  command->add_flag("--no-clips", arguments->no_clips, "HTML without the clips' key frames and loss curves");
  command->add_option("-j,--threads", arguments->threads, "threads")->capture_default_str();
  command->callback([&session, arguments] { run_report(session, *arguments); });
}

}  // namespace duet::cli
