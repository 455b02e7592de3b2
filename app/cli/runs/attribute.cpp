// duet attribute: why two settings of an engine differ, by the same episodes in every cell of a factorial between them.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "duet/app/cli/run_notes.h"
#include "duet/app/cli/runs/run.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/plan/switches.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/report/studies/attribution.h"

namespace duet::cli {
namespace {

struct AttributeArguments {
  RunArguments run;
  SwitchOptions sides;
  std::vector<std::string> groups;  // NAME=KEY,KEY
  AttributionOptions options;
};

// "contact=erp,slop" -> the switch of each key.
std::map<std::string, std::string> names_of_keys(const std::vector<std::string>& groups) {
  std::map<std::string, std::string> names;
  for (const std::string& group : groups) {
    const auto [name, keys] = split_assignment(group);
    require(is_plain_name(name), "--group {}: {}", excerpt(group), plain_name_message(name));
    for (const std::string_view key : split(keys, ',')) names[std::string(key)] = name;
  }
  return names;
}

Suite suite_with_engines(const RunArguments& run) {
  Suite suite = suite_of(run.suite);
  check_filters(run.options, suite);
  if (!run.options.engines.empty()) suite.engines = run.options.engines;
  return suite;
}

std::string text_of(const SwitchedSuite& suite) {
  std::string text;
  for (const EngineSwitch& each : suite.switches()) text += fmt::format("{}: {}\n", each.name, each.text());
  return text;
}

std::string folder_of(const AttributeArguments& arguments, const std::string& cell) {
  return join_without_links(join_without_links(arguments.run.output, "cells"), cell);
}

// Runs the cells that are not there yet. Returns whether all of them are whole; else the session's exit code says why.
bool run_cells(Session& session, const AttributeArguments& arguments, const SwitchedSuite& suite) {
  Progress progress(session.progress());
  for (unsigned cell = 0; cell < suite.cells(); ++cell) {
    RunArguments run = arguments.run;
    run.output = folder_of(arguments, suite.cell_name(cell));
    run.options.engines.clear();
    run.options.clips_in = arguments.run.output;
    note(session, fmt::format("cell {} of {}: {}", cell + 1, suite.cells(), suite.cell_name(cell)));
    const RunSummary summary = run_watched(suite.cell(cell), run, progress);
    for (const std::string& warning : summary.warnings) warn(warning);
    warn_of_timeouts(summary.outcomes);
    if (!summary.first_error.empty()) warn(summary.first_error);
    session.exit_code = std::max(session.exit_code, exit_code(summary));
    if (summary.end == RunEnd::kComplete) continue;
    note(session, "stopped early; the same command goes on where it stopped");
    return false;
  }
  remove_prepared_clips(arguments.run.output);
  return true;
}

AttributionRows rows_of(const AttributeArguments& arguments, const SwitchedSuite& suite) {
  AttributionRows rows{.switches = suite.names(), .settings = {}, .cell_names = {}, .cells = {}};
  for (const EngineSwitch& each : suite.switches()) rows.settings.push_back(each.text());
  for (unsigned cell = 0; cell < suite.cells(); ++cell) {
    rows.cell_names.push_back(suite.cell_name(cell));
    rows.cells.push_back(open_run(folder_of(arguments, suite.cell_name(cell)), RowExtent::kLean).rows);
    std::erase_if(rows.cells.back(), [&](const EpisodeRow& row) {
      return !chosen(arguments.run.options.controllers, row.controller) ||
             !chosen(arguments.run.options.policies, row.policy) || !chosen(arguments.run.options.tasks, row.task) ||
             !chosen(arguments.run.options.perturbations, row.perturbation);
    });
    for (EpisodeRow& row : rows.cells.back()) row.engine = suite.engine_of(row.engine);
  }
  return rows;
}

void write_files(const std::string& folder, const Analysis& analysis) {
  FileBatch batch;
  for (const char* format : {"md", "csv", "json", "tex"})
    for (const auto& [name, text] : analysis_files({analysis}, format))
      batch.write(join_without_links(folder, name), text);
  batch.write(join_without_links(folder, "attribution.svg"), attribution_svg(analysis));
  batch.put_in_place();
}

void run_attribute(Session& session, AttributeArguments arguments) {
  catch_interrupts();
  arguments.sides.names = names_of_keys(arguments.groups);
  const SwitchedSuite suite(suite_with_engines(arguments.run), arguments.sides);
  if (arguments.run.dry_run) {
    std::vector<std::string> cells;
    for (unsigned cell = 0; cell < suite.cells(); ++cell) cells.push_back(suite.cell_name(cell));
    print(session, fmt::format("{}cells: {}\n", text_of(suite), fmt::join(cells, ", ")),
          {{"switches", suite.names()}, {"cells", cells}});
    return;
  }
  require(!arguments.run.output.empty(), "--output is needed: a folder for the cells' runs and the figures");
  arguments.run.options.argv = session.argv;
  arguments.run.options.begin = session.begin;
  if (!run_cells(session, arguments, suite)) return;
  const AttributionRows rows = rows_of(arguments, suite);
  const Analysis analysis = attribution_analysis(rows, arguments.options);
  write_files(arguments.run.output, analysis);
  std::size_t episodes = 0;
  for (const std::vector<EpisodeRow>& cell : rows.cells) episodes += cell.size();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - session.begin).count();
  const std::string took = fmt::format("{} cells, {} episodes; this call took {:.0f} s on {} threads\n", suite.cells(),
                                       episodes, seconds, arguments.run.options.threads);
  print(session, fmt::format("{}\n{}{}\n{}", text_of(suite), attribution_bars(analysis), terminal_text(analysis), took),
        {{"run", arguments.run.output},
         {"switches", suite.names()},
         {"cells", rows.cell_names},
         {"episodes", episodes},
         {"attribution", analysis_json(analysis)}});
  suggest_next(session, fmt::format("open {} in a browser",
                                    shell_word(join_without_links(arguments.run.output, "attribution.svg"))));
}

void add_sides(CLI::App& command, AttributeArguments& arguments) {
  command.add_option("--from", arguments.sides.from,
                     "where it starts: an engine profile, a file, or settings as for --to (default: the suite's)");
  command
      .add_option("--to", arguments.sides.to,
                  "where it ends: a profile, a file, or settings on top of --from: law=explicit,dt=0.001 or "
                  "mujoco.cone=pyramidal of one engine; engine=NAME puts another engine in the place of the only one")
      ->required();
  command.add_option("--group", arguments.groups,
                     "NAME=KEY,KEY: these settings are one switch (repeatable; default: what means one thing in every "
                     "engine is one)");
  command
      .add_option("--holdout", arguments.options.holdout,
                  "share of the clips on which the switches are tried that were found on the others; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 0.9));
}

}  // namespace

void add_attribute(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "attribute",
      "why two settings of an engine differ: the same episodes in all combinations of what differs, effects, "
      "interactions and shares with intervals; resumes by itself",
      "duet attribute policies --engines bullet --to law=explicit,armature=0,dt=0.001 -o runs/why\n"
      "  duet attribute demo --from parity --to fast --engines mujoco,bullet -o runs/fast");
  auto arguments = std::make_shared<AttributeArguments>();
  RunOptions& options = arguments->run.options;
  options.threads = default_threads();
  add_suite_options(*command, arguments->run.suite);
  add_sides(*command, *arguments);
  command->add_option("-o,--output", arguments->run.output,
                      "folder: a run directory for each cell in cells/, and the figures");
  add_filters(*command, options);
  add_threads(command, options.threads);
  add_time_limit(*command, options);
  command->add_flag("--retry-errors", options.retry_errors, "run episodes again that ended with an error");
  command->add_option("--level", arguments->options.level, "of intervals")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 0.9999));
  command->add_option("--resamples", arguments->options.resamples, "of the bootstrap over clips")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_option("--seed", arguments->options.seed, "of the bootstrap and of the clips that are held out")
      ->capture_default_str();
  command->add_flag("--dry-run", arguments->run.dry_run, "print the switches and the cells; run nothing");
  command->callback([&session, arguments] { run_attribute(session, *arguments); });
}

}  // namespace duet::cli
