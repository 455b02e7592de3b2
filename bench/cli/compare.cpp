// duet compare: two runs on the same episodes, tested in pairs.
#include <fmt/format.h>

#include "bench/cli/command.h"
#include "results/leaderboard.h"
#include "results/run_directory.h"

namespace duet::cli {
namespace {

struct CompareArguments {
  std::string a, b;
  LeaderboardOptions options;
};

void run_compare(const Session& session, const CompareArguments& arguments) {
  const Run a = load_run(arguments.a);
  const Run b = load_run(arguments.b);
  const std::vector<Comparison> comparisons = compare_runs(a.rows, b.rows, arguments.options);
  print(session, fmt::format("A = {}\nB = {}\n\n{}", arguments.a, arguments.b, comparison_markdown(comparisons)),
        {{"a", arguments.a}, {"b", arguments.b}, {"comparisons", comparison_json(comparisons)}});
}

}  // namespace

void add_compare(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "compare",
                  "two runs on the same episodes: exact paired tests, intervals, the smallest difference they can see",
                  "duet compare runs/policy_a runs/policy_b");
  auto arguments = std::make_shared<CompareArguments>();
  command->add_option("a", arguments->a, "run directory A")->required();
  command->add_option("b", arguments->b, "run directory B")->required();
  command->add_option("--level", arguments->options.level, "of intervals")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 0.9999));
  command->add_option("--resamples", arguments->options.resamples, "of the cluster bootstrap")->capture_default_str();
  command->add_option("--seed", arguments->options.seed, "of the cluster bootstrap")->capture_default_str();
  command->callback([&session, arguments] { run_compare(session, *arguments); });
}

}  // namespace duet::cli
