// duet bless, duet check: golden baselines.
#include "duet/report/ranking/golden.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/core/naming_file.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {
namespace {

struct GoldenArguments {
  std::string run, file;
  bool partial = false, exact = false;
};

void run_bless(const Session& session, const GoldenArguments& arguments) {
  const Run run = open_run(arguments.run);
  require_whole(run, arguments.run, arguments.partial, "bless");
  write_file(arguments.file, bless(leaderboard(run.rows), run.info));
  const std::vector<std::string> notes = completeness_notes({arguments.run}, {run});
  print(session,
        with_notes("md",
                   fmt::format("{}: baseline of {} {} from {} episodes", arguments.file, run.info.suite,
                               run.info.suite_version, run.rows.size()),
                   notes),
        {{"file", arguments.file}, {"episodes", run.rows.size()}, {"notes", notes}});
}

std::string text_of(const GoldenDifference& difference) {
  if (!difference.missing)
    return fmt::format("{}: expected {:g} +- {:g}, found {:g}\n", difference.where, difference.expected,
                       difference.tolerance, difference.found);
  if (!std::isnan(difference.expected))
    return fmt::format("{}: expected {:g}, not in the run\n", difference.where, difference.expected);
  return fmt::format("{}: not in the run ({} figures)\n", difference.where, difference.figures);
}

nlohmann::json json_of(const GoldenDifference& difference) {
  nlohmann::json json = {{"where", difference.where}, {"missing", difference.missing}, {"figures", difference.figures}};
  const auto add = [&](const char* name, double value) {
    if (!std::isnan(value)) json[name] = value;
  };
  add("expected", difference.expected);
  add("tolerance", difference.tolerance);
  add("found", difference.found);
  return json;
}

void check_exactly(Session& session, const GoldenArguments& arguments, const Run& run) {
  const Run baseline = load_run(arguments.file);
  const std::vector<std::string> differences = exact_differences(baseline, run);
  std::string text;
  for (const std::string& difference : differences) text += difference + "\n";
  text += differences.empty() ? fmt::format("all {} episodes are the same in every field", baseline.rows.size())
                              : fmt::format("{} of {} episodes differ", differences.size(), baseline.rows.size());
  print(session, text, {{"differences", differences}, {"passed", differences.empty()}});
  if (!differences.empty()) session.exit_code = kExitGate;
}

void run_check(Session& session, const GoldenArguments& arguments) {
  const Run run = open_run(arguments.run);
  if (arguments.exact) return check_exactly(session, arguments, run);
  const std::vector<std::string> notes = completeness_notes({arguments.run}, {run});
  const std::string golden = read_text(arguments.file);
  const std::vector<GoldenDifference> differences =
      naming_file(arguments.file, [&] { return check(golden, leaderboard(run.rows), run.info); });
  nlohmann::json json = nlohmann::json::array();
  std::string text;
  for (const GoldenDifference& difference : differences) {
    json.push_back(json_of(difference));
    text += text_of(difference);
  }
  text += differences.empty() ? "every figure agrees with the baseline"
                              : fmt::format("{} figures differ", differences.size());
  print(session, with_notes("md", text, notes),
        {{"differences", json}, {"passed", differences.empty()}, {"notes", notes}});
  if (!differences.empty()) session.exit_code = kExitGate;
}

}  // namespace

void add_bless(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "bless", "write a run's figures, with tolerances, as the golden baseline",
                  "duet bless runs/core --output golden/core.json");
  auto arguments = std::make_shared<GoldenArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-o,--output", arguments->file, "baseline to write (JSON)")->required();
  command->add_flag("--partial", arguments->partial, "also a run that lacks episodes that were asked for");
  command->callback([&session, arguments] { run_bless(session, *arguments); });
}

void add_check(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "check", "hold a run against a golden baseline (exit code 1 where it differs)",
                  "duet check runs/core --baseline golden/core.json");
  auto arguments = std::make_shared<GoldenArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-b,--baseline", arguments->file, "baseline (JSON); with --exact a run directory")->required();
  command->add_flag("--exact", arguments->exact, "hold every field of every episode against those of another run");
  command->callback([&session, arguments] { run_check(session, *arguments); });
}

}  // namespace duet::cli
