// duet verify: whether a run's rows are what its suite makes, and episodes of it run again.
#include <fmt/format.h>

#include <algorithm>
#include <random>

#include "duet/app/command.h"
#include "duet/core/machine.h"
#include "duet/execution/verification.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/rows/folder/environment.h"

namespace duet::cli {
namespace {

struct VerifyArguments {
  std::string run;
  std::optional<std::uint64_t> seed;
  bool partial = false, allow_timeouts = false;
  VerifyOptions options;
};

std::string line_of(const RepeatedEpisode& repeat) {
  const EpisodeRow& row = repeat.row;
  const char* verdict = repeat.differences.empty() ? "same" : repeat.time_out.empty() ? "DIFFERENT" : "TIMEOUT";
  std::string more = repeat.time_out.empty() ? "" : "; " + repeat.time_out;
  if (!repeat.differences.empty() && more.empty()) more = "; stored, now: " + differences_text(repeat.differences);
  return fmt::format("{:<9} {} {}/{}/{} {} {:.12} {:.12}{}\n", verdict, row.clip, row.engine, row.controller,
                     row.policy, row.arm, row.state_hash, repeat.state_hash, more);
}

nlohmann::json json_of(const RepeatedEpisode& repeat) {
  nlohmann::json fields = nlohmann::json::array();
  for (const FieldDifference& difference : repeat.differences)
    fields.push_back({{"field", difference.field}, {"before", difference.first}, {"now", difference.second}});
  return {{"key", repeat.row.key},           {"same", repeat.differences.empty()}, {"time_out", repeat.time_out},
          {"before", repeat.row.state_hash}, {"now", repeat.state_hash},           {"differences", fields}};
}

// Sentences about the rows that were not held against anything.
std::string open_text(const Verification& found, const VerifyArguments& arguments) {
  std::string text;
  if (static_cast<int>(found.repeats.size()) < found.repeatable)
    text += fmt::format(" (drawn from {} by --seed {}; --all runs them all)", found.repeatable, arguments.options.seed);
  if (found.timed_out() > 0)
    text += fmt::format("; {} timed out there or here and ended in the other (--allow-timeouts lets them pass)",
                        found.timed_out());
  for (const auto& [why, rows] : found.not_run) text += fmt::format("; {} rows were not run: {}", rows, why);
  return text;
}

std::string text_of(const Verification& found, const VerifyArguments& arguments, const RunInfo& info,
                    const std::string& other_maker) {
  const std::string note = shipped_suite_note(info);
  std::string text = fmt::format("{} {}{}\n", info.suite, info.suite_version, note.empty() ? "" : ": " + note);
  for (const std::string& fault : found.faults) text += fmt::format("WRONG     {}\n", fault);
  for (const std::string& missing : found.missing) text += fmt::format("MISSING   {}\n", missing);
  constexpr std::size_t kShown = 3;
  for (std::size_t i = 0; i < std::min(kShown, found.not_asked.size()); ++i)
    text += fmt::format("LEFT OUT  {}\n", found.not_asked[i]);
  if (found.not_asked.size() > kShown)
    text += fmt::format("LEFT OUT  {} more that were not asked for (--json)\n", found.not_asked.size() - kShown);
  for (const RepeatedEpisode& repeat : found.repeats) text += line_of(repeat);
  if (found.asked < found.episodes)
    text += fmt::format("a part of its suite: {} of {} episodes were asked for\n", found.asked, found.episodes);
  const int apart = found.different() + found.timed_out();
  text += fmt::format("{} of {} episodes repeat bit for bit{}", static_cast<int>(found.repeats.size()) - apart,
                      found.repeats.size(), open_text(found, arguments));
  if (!other_maker.empty()) text += '\n' + other_maker;
  return text;
}

nlohmann::json json_of(const Verification& found, const VerifyArguments& arguments, const RunInfo& info) {
  nlohmann::json episodes = nlohmann::json::array();
  for (const RepeatedEpisode& repeat : found.repeats) episodes.push_back(json_of(repeat));
  return {{"suite", fmt::format("{} {}", info.suite, info.suite_version)},
          {"suite_note", shipped_suite_note(info)},
          {"episodes", episodes},
          {"different", found.different()},
          {"timed_out", found.timed_out()},
          {"faults", found.faults},
          {"missing", found.missing},
          {"not_asked", found.not_asked},
          {"not_repeatable", found.rows_not_run()},
          {"not_run", found.not_run},
          {"seed", arguments.options.seed}};
}

int code_of(const Verification& found, const VerifyArguments& arguments) {
  const bool differs = found.different() > 0 || (found.timed_out() > 0 && !arguments.allow_timeouts);
  // A user who asks for all of a run is told where it is not all of its suite.
  const bool whole = found.missing.empty() && (found.not_asked.empty() || !arguments.options.all);
  if (differs || !found.faults.empty() || (!whole && !arguments.partial)) return kExitDeterminism;
  return arguments.options.all && found.rows_not_run() > 0 ? kExitMissing : kExitOk;
}

void run_verify(Session& session, VerifyArguments arguments) {
  const Run run = load_run(arguments.run);
  // A draw that is known beforehand is no check.
  arguments.options.seed = arguments.seed.value_or(std::random_device()());
  Progress progress(session.progress());
  const Verification found = verify_run(run, arguments.options, progress);
  const std::string other_maker =
      found.different() > 0 ? other_maker_sentences(run.info.environment, capture_environment()) : "";
  print(session, text_of(found, arguments, run.info, other_maker), json_of(found, arguments, run.info));
  session.exit_code = code_of(found, arguments);
}

}  // namespace

void add_verify(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "verify",
                                  "hold every row against the suite's plan, run episodes again and compare all fields "
                                  "(exit code 5 where they differ; with --all 4 where rows could not be run here)",
                                  "duet verify runs/core --episodes 10");
  auto arguments = std::make_shared<VerifyArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-k,--episodes", arguments->options.episodes, "how many to run again, drawn at random")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_flag("--all", arguments->options.all,
                    "run all of them again, and expect all of the suite (exit code 5 where run.json says that a part "
                    "was not asked for, unless --partial)");
  command->add_flag("--allow-timeouts", arguments->allow_timeouts,
                    "an episode may time out on one machine and end on the other");
  command->add_option("--seed", arguments->seed, "of the draw (default: another one each time, printed)");
  command
      ->add_option(
          "--clips", arguments->options.clips,
          "file or folder with the clips, where the run was published without them; they are found by what is in them")
      ->check(CLI::ExistingPath);
  command->add_flag("--partial", arguments->partial,
                    "episodes of the suite may be missing: the run is not finished, or of a part of it");
  add_threads(command, arguments->options.threads);
  add_allow_programs(*command, arguments->options.allow_programs);
  command->callback([&session, arguments] { run_verify(session, *arguments); });
}

}  // namespace duet::cli
