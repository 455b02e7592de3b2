// duet compare: two runs on the same episodes, tested in pairs.
#include <fmt/format.h>

#include <cmath>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/execution/report_content.h"
#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/golden.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/groups/row_groups.h"

namespace duet::cli {
namespace {

struct CompareArguments {
  std::string a, b;
  double min_effect = 100.0 * kFivePoints;  // [points]
  IntervalOptions options;
};

using Digests = std::map<std::string, std::string>;

// Names that stand for something else in B: what is compared is then that.
void add_other_digests(const char* kind, const Digests& a, const Digests& b, std::vector<std::string>& notes) {
  for (const auto& [name, digest] : a)
    if (const auto other = b.find(name); other != b.end() && other->second != digest)
      notes.push_back(
          fmt::format("{} '{}' is {} in A and {} in B", kind, name, short_digest(digest), short_digest(other->second)));
}

std::vector<std::string> comparison_notes(const CompareArguments& arguments, const Run& a, const Run& b) {
  std::vector<std::string> notes =
      with_suite(board_suite(a.info), completeness_notes({arguments.a, arguments.b}, {a, b}));
  if (a.info.suite_hash != b.info.suite_hash)
    notes.push_back(fmt::format("the suite's hash is {} in A and {} in B: other settings, clips or detectors",
                                short_digest(a.info.suite_hash), short_digest(b.info.suite_hash)));
  add_other_digests("policy", a.info.policies, b.info.policies, notes);
  add_other_digests("controller", a.info.controllers, b.info.controllers, notes);
  for (const auto& [name, run] : {std::pair("A", &a), std::pair("B", &b)})
    if (const std::string repeats = repeats_note(run->rows); !repeats.empty()) {
      warn(fmt::format("{}: {}", name, repeats));
      notes.push_back(fmt::format("{}: {}", name, repeats));
    }
  return notes;
}

void run_compare(const Session& session, const CompareArguments& arguments) {
  const Run a = open_run(arguments.a);
  const Run b = open_run(arguments.b);
  const std::vector<std::string> notes = comparison_notes(arguments, a, b);
  const Analysis analysis = with_file_context(fmt::format("A = {}, B = {}", arguments.a, arguments.b), [&] {
    return comparison_analysis(a.rows, b.rows, arguments.options, arguments.min_effect / 100.0);
  });
  const std::string text = fmt::format("A = {}\nB = {}\n\n{}", arguments.a, arguments.b, terminal_text(analysis));
  print(session, with_notes("md", text, notes),
        {{"a", arguments.a}, {"b", arguments.b}, {"comparison", analysis_json(analysis)}, {"notes", notes}});
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
  command->add_option("--min-effect", arguments->min_effect, "margin [points] within which two runs are the same")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 99.0));
  command->add_option("--resamples", arguments->options.resamples, "of the cluster bootstrap")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_option("--seed", arguments->options.seed, "of the cluster bootstrap")->capture_default_str();
  command->callback([&session, arguments] { run_compare(session, *arguments); });
}

// duet bless, duet check: golden baselines.

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
      with_file_context(arguments.file, [&] { return check(golden, leaderboard(run.rows), run.info); });
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
