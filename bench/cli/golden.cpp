// duet bless, duet check: golden baselines.
#include "results/golden.h"

#include <fmt/format.h>

#include "bench/cli/command.h"
#include "core/file.h"
#include "results/run_directory.h"

namespace duet::cli {
namespace {

struct GoldenArguments {
  std::string run, file;
};

void run_bless(const Session& session, const GoldenArguments& arguments) {
  const Run run = load_run(arguments.run);
  write_file(arguments.file, bless(leaderboard(run.rows), run.info.suite, run.info.suite_version));
  print(session,
        fmt::format("{}: baseline of {} {} from {} episodes", arguments.file, run.info.suite, run.info.suite_version,
                    run.rows.size()),
        {{"file", arguments.file}, {"episodes", run.rows.size()}});
}

void run_check(Session& session, const GoldenArguments& arguments) {
  const Run run = load_run(arguments.run);
  const std::vector<GoldenDifference> differences =
      check(read_file(arguments.file), leaderboard(run.rows), run.info.suite, run.info.suite_version);
  nlohmann::json json = nlohmann::json::array();
  std::string text;
  for (const GoldenDifference& difference : differences) {
    nlohmann::json entry = {{"where", difference.where},
                            {"expected", difference.expected},
                            {"missing", difference.missing},
                            {"tolerance", difference.tolerance}};
    if (!difference.missing) entry["found"] = difference.found;
    json.push_back(entry);
    text += difference.missing
                ? fmt::format("{}: expected {:g}, not in the run\n", difference.where, difference.expected)
                : fmt::format("{}: expected {:g} +- {:g}, found {:g}\n", difference.where, difference.expected,
                              difference.tolerance, difference.found);
  }
  text += differences.empty() ? "every figure agrees with the baseline"
                              : fmt::format("{} figures differ", differences.size());
  print(session, text, {{"differences", json}, {"passed", differences.empty()}});
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
  command->callback([&session, arguments] { run_bless(session, *arguments); });
}

void add_check(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "check", "hold a run against a golden baseline (exit code 1 where it differs)",
                  "duet check runs/core --baseline golden/core.json");
  auto arguments = std::make_shared<GoldenArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-b,--baseline", arguments->file, "baseline (JSON)")->required();
  command->callback([&session, arguments] { run_check(session, *arguments); });
}

}  // namespace duet::cli
