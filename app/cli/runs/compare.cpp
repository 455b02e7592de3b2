// duet compare: two runs on the same episodes, tested in pairs.
#include <fmt/format.h>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/naming_file.h"
#include "duet/execution/story.h"
#include "duet/report/ranking/comparison.h"
#include "duet/rows/folder/name_digests.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/groups/distinct_episodes.h"

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
  const Analysis analysis = naming_file(fmt::format("A = {}, B = {}", arguments.a, arguments.b), [&] {
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

}  // namespace duet::cli
