// duet verify: whether a run's rows are what its suite makes, and episodes of it run again.
#include <fmt/format.h>

#include <random>

#include "duet/bench/cli/command.h"
#include "duet/bench/verification.h"
#include "duet/core/parallel.h"
#include "duet/results/rows/environment.h"

namespace duet::cli {
namespace {

struct VerifyArguments {
  std::string run;
  std::optional<std::uint64_t> seed;
  bool partial = false;
  VerifyOptions options;
};

std::string line_of(const RepeatedEpisode& repeat) {
  const EpisodeRow& row = repeat.row;
  const bool same = repeat.differences.empty();
  return fmt::format("{:<9} {} {}/{}/{} {} {:.12} {:.12}{}\n", same ? "same" : "DIFFERENT", row.clip, row.engine,
                     row.controller, row.policy, row.arm, row.state_hash, repeat.state_hash,
                     same ? "" : "; stored, now: " + differences_text(repeat.differences));
}

nlohmann::json json_of(const RepeatedEpisode& repeat) {
  nlohmann::json fields = nlohmann::json::array();
  for (const FieldDifference& difference : repeat.differences)
    fields.push_back({{"field", difference.field}, {"before", difference.first}, {"now", difference.second}});
  return {{"key", repeat.row.key},
          {"same", repeat.differences.empty()},
          {"before", repeat.row.state_hash},
          {"now", repeat.state_hash},
          {"differences", fields}};
}

std::string text_of(const Verification& found, const VerifyArguments& arguments, const std::string& other_machine) {
  std::string text;
  for (const std::string& fault : found.faults) text += fmt::format("WRONG     {}\n", fault);
  for (const std::string& missing : found.missing) text += fmt::format("MISSING   {}\n", missing);
  for (const RepeatedEpisode& repeat : found.repeats) text += line_of(repeat);
  text += fmt::format("{} of {} episodes repeat bit for bit", found.repeats.size() - found.different(),
                      found.repeats.size());
  if (static_cast<int>(found.repeats.size()) < found.repeatable)
    text += fmt::format(" (drawn from {} by --seed {}; --all runs them all)", found.repeatable, arguments.options.seed);
  if (found.not_repeatable > 0)
    text += fmt::format("; {} timed out or need what this machine lacks and were not run", found.not_repeatable);
  if (found.different() > 0 && !other_machine.empty()) text += '\n' + other_machine;
  return text;
}

void run_verify(Session& session, VerifyArguments arguments) {
  const Run run = load_run(arguments.run);
  // A draw that is known beforehand is no check.
  arguments.options.seed = arguments.seed.value_or(std::random_device()());
  Progress progress(session.progress());
  const Verification found = verify_run(run, arguments.options, progress);
  nlohmann::json episodes = nlohmann::json::array();
  for (const RepeatedEpisode& repeat : found.repeats) episodes.push_back(json_of(repeat));
  const std::string other_machine = other_machine_sentence(run.info.environment, describe_machine());
  print(session, text_of(found, arguments, other_machine),
        {{"episodes", episodes},
         {"different", found.different()},
         {"faults", found.faults},
         {"missing", found.missing},
         {"not_repeatable", found.not_repeatable},
         {"seed", arguments.options.seed}});
  const bool whole = found.missing.empty() || arguments.partial;
  if (found.different() > 0 || !found.faults.empty() || !whole) session.exit_code = kExitDeterminism;
}

}  // namespace

void add_verify(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "verify",
                                  "hold every row against the suite's plan, run episodes again and compare all fields "
                                  "(exit code 5 where they differ)",
                                  "duet verify runs/core --episodes 10");
  auto arguments = std::make_shared<VerifyArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-k,--episodes", arguments->options.episodes, "how many to run again, drawn at random")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_flag("--all", arguments->options.all, "run all of them again");
  command->add_option("--seed", arguments->seed, "of the draw (default: another one each time, printed)");
  command
      ->add_option(
          "--clips", arguments->options.clips,
          "file or folder with the clips, where the run was published without them; they are found by what is in them")
      ->check(CLI::ExistingPath);
  command->add_flag("--partial", arguments->partial, "episodes may be missing: the run is not finished");
  add_threads(command, arguments->options.threads);
  add_allow_programs(*command, arguments->options.allow_programs);
  command->callback([&session, arguments] { run_verify(session, *arguments); });
}

}  // namespace duet::cli
