// duet work: one shard of a planned run.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdlib>

#include "duet/app/cli/run_notes.h"
#include "duet/cluster/work_shard.h"
#include "duet/core/file.h"
#include "duet/experiment/work/interrupt.h"
#include "duet/experiment/work/run_work.h"
#include "duet/parts/cluster/part.h"

namespace duet::cli {
namespace {

struct WorkArguments {
  std::string run;
  std::int64_t shard = 0;
  double time_limit = 0.0;
  WorkOptions options;
};

constexpr double kWorkGrace = 3.0;  // [s] after the sign: a worker is to be gone within five

int code_of(RunEnd end) {
  return end == RunEnd::kComplete ? kExitOk : end == RunEnd::kInterrupted ? kExitInterrupted : kExitResumable;
}

// Nothing that is finished is lost: each row is on disk before the next episode ends.
[[noreturn]] void leave_at_once(RunEnd end) {
  print_error("duet: stopped in the middle of a step that cannot be stopped; the same command goes on\n");
  std::_Exit(code_of(end));
}

int code_of(const WorkSummary& summary) {
  if (summary.end != RunEnd::kComplete) return code_of(summary.end);
  if (summary.exit_code != 0) return summary.exit_code;
  return has_faults(summary.outcomes) ? kExitErrors : kExitOk;
}

std::string text_of(const WorkSummary& summary, const WorkArguments& arguments) {
  std::vector<std::string> outcomes;
  for (const auto& [outcome, count] : summary.outcomes) outcomes.push_back(fmt::format("{} {}", count, outcome));
  std::string text =
      fmt::format("shard {} of {}: {} of {} done ({} were there, {} run now{}{})\n", arguments.shard, arguments.run,
                  summary.already_there + summary.run, summary.planned, summary.already_there, summary.run,
                  outcomes.empty() ? "" : ": ", fmt::join(outcomes, ", "));
  if (summary.poisoned > 0)
    text += fmt::format("{} of them killed their workers before and are rows with an error\n", summary.poisoned);
  if (summary.end != RunEnd::kComplete) text += "stopped early; the same command goes on where it stopped\n";
  return text;
}

void run_work(Session& session, const WorkArguments& arguments) {
  catch_interrupts();
  const StopSign stop(arguments.time_limit, session.begin);
  const StopWatch watch(stop, kWorkGrace, leave_at_once);
  Progress progress(session.progress());
  try {
    const WorkSummary summary = work_shard(arguments.run, arguments.shard, arguments.options, stop, progress);
    session.exit_code = code_of(summary);
    warn_of_timeouts(summary.outcomes);
    if (!summary.first_error.empty()) warn(errors_sentence(summary.outcomes.at("error"), summary.first_error));
    print(session, text_of(summary, arguments),
          {{"run", arguments.run},
           {"shard", arguments.shard},
           {"planned", summary.planned},
           {"already_there", summary.already_there},
           {"run_now", summary.run},
           {"outcomes", summary.outcomes},
           {"poisoned", summary.poisoned},
           {"complete", summary.end == RunEnd::kComplete && summary.exit_code == 0}});
  } catch (const StorageError& error) {
    throw StorageError(fmt::format("{}; the worker has stopped and the same command goes on", error.what()));
  }
}

}  // namespace

void add_work(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "work",
                                  "run what is missing of one shard of a planned run; anything that can count may "
                                  "start it, and again after a kill (exit code 75: stopped, goes on)",
                                  "duet work runs/core --shard 17");
  auto arguments = std::make_shared<WorkArguments>();
  command->add_option("run", arguments->run, "run directory that `duet plan` made")->required();
  command->add_option("--shard", arguments->shard, "its number, from 0")
      ->required()
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{1'000'000}));
  add_threads(command, arguments->options.threads, "episodes at the same time");
  command->add_option("--time-limit", arguments->time_limit, "of the command [s], 0 for none")
      ->check(CLI::Range(0.0, 1.0e9));
  command->add_flag(
      "--retry-errors", arguments->options.retry_errors,
      "run episodes again that ended with an error, those that killed their workers too (time-outs always run again)");
  add_allow_programs(*command, arguments->options.allow_programs);
  command->callback([&session, arguments] { run_work(session, *arguments); });
}

}  // namespace duet::cli
