// duet work: one shard of a planned run.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "duet/app/cli/run_notes.h"
#include "duet/cluster/merge.h"
#include "duet/cluster/run_status.h"
#include "duet/cluster/work_shard.h"
#include "duet/core/file.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"
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
  const StopToken stop(arguments.time_limit, session.begin);
  const Watchdog watch(stop, kWorkGrace, leave_at_once);
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

// duet status: how far a planned run is.

namespace {

struct StatusArguments {
  std::string run;
  bool watch = false, unfinished = false;
  double every = 5.0;  // [s]
};

// A number a line, for what counts: `for`, GNU parallel, Snakemake.
std::string unfinished_text(const RunStatus& status) {
  std::string text;
  for (const ShardStatus& shard : status.shards)
    if (shard.state != ShardState::kDone) text += fmt::format("{}\n", shard.number);
  return text;
}

// Waits in short steps, so that a signal ends it soon.
void wait_for_next(double seconds) {
  constexpr std::chrono::milliseconds kStep(100);
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < until && interrupt() == Interrupt::kNone)
    std::this_thread::sleep_for(kStep);
}

void run_status_command(Session& session, const StatusArguments& arguments) {
  catch_interrupts();
  for (;;) {
    const RunStatus status = run_status(arguments.run);
    print(session, arguments.unfinished ? unfinished_text(status) : status_text(status), status_json(status));
    if (!arguments.watch || status.is_complete() || interrupt() != Interrupt::kNone) break;
    wait_for_next(arguments.every);
    if (interrupt() != Interrupt::kNone) break;
  }
  if (interrupt() != Interrupt::kNone)
    session.exit_code = interrupt() == Interrupt::kInterrupted ? kExitInterrupted : kExitResumable;
}

}  // namespace

void add_status(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "status",
                                  "how far a planned run is: done, running, failed, time left, by node and by shard",
                                  "duet status runs/core --watch");
  auto arguments = std::make_shared<StatusArguments>();
  command->add_option("run", arguments->run, "run directory that `duet plan` made")->required();
  command->add_flag("--unfinished", arguments->unfinished,
                    "only the numbers of the shards that are not done, a line each");
  command->add_flag("--watch", arguments->watch, "again and again, until all is done");
  command->add_option("--every", arguments->every, "time between two looks [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 3600.0));
  command->callback([&session, arguments] { run_status_command(session, *arguments); });
}

// duet merge: the runs of several people as one, or what many machines have done of a planned one.

namespace {

struct MergeArguments {
  std::vector<std::string> runs;
  MergeOptions options;
};

constexpr std::size_t kMostGaps = 20;  // that are printed

std::string gaps_text(const MergeSummary& summary) {
  if (summary.planned == 0) return "";
  if (summary.gaps.empty()) return fmt::format("; all {} planned episodes are there", summary.planned);
  std::int64_t missing = 0;
  for (const ShardGap& gap : summary.gaps) missing += gap.episodes - gap.rows;
  std::string text = fmt::format("; {} of {} planned episodes are missing, of {} shards:\n", missing, summary.planned,
                                 summary.gaps.size());
  for (std::size_t i = 0; i < std::min(summary.gaps.size(), kMostGaps); ++i) {
    const ShardGap& gap = summary.gaps[i];
    text += fmt::format("  {}: shard {}: {} of {} episodes\n", gap.run, gap.shard, gap.rows, gap.episodes);
  }
  if (summary.gaps.size() > kMostGaps) text += fmt::format("  and {} shards more\n", summary.gaps.size() - kMostGaps);
  return text;
}

std::string nodes_text(const MergedRows& rows) {
  std::string text;
  for (const auto& [node, count] : rows.of_node) text += fmt::format("{}: {} rows\n", node, count);
  for (const auto& [pair, agreement] : rows.agreement)
    text += fmt::format("{} and {}: {} episodes that both ran, {} differ\n", pair.first, pair.second,
                        agreement.compared, agreement.different);
  return text;
}

std::string text_of(const MergeSummary& summary, const MergeArguments& arguments) {
  const MergedRows& rows = summary.rows;
  std::string text;
  for (const std::string& conflict : rows.conflicts) text += conflict + "\n";
  if (rows.violations > std::ssize(rows.conflicts))
    text += fmt::format("and {} episodes more\n", rows.violations - std::ssize(rows.conflicts));
  text += nodes_text(rows);
  if (!summary.written)
    return text + fmt::format("{} episodes are not the same in all runs: nothing was written", rows.violations);
  const std::string& to = arguments.options.output.empty() ? arguments.runs.front() : arguments.options.output;
  text += fmt::format("{}: {} episodes of {} runs; {} that more than one had are equal and there once", to, rows.rows,
                      arguments.runs.size(), rows.folded);
  if (rows.superseded > 0) text += fmt::format("; {} errors and time-outs gave way to another row", rows.superseded);
  if (rows.errors > 0) text += fmt::format("; {} ended with an error", rows.errors);
  if (rows.timeouts > 0) text += fmt::format("; {} timed out", rows.timeouts);
  if (rows.torn > 0) text += fmt::format("; {} last lines were not whole and are left out", rows.torn);
  return text + gaps_text(summary);
}

nlohmann::json json_of(const MergeSummary& summary, const MergeArguments& arguments) {
  const MergedRows& rows = summary.rows;
  const std::string& to = arguments.options.output.empty() ? arguments.runs.front() : arguments.options.output;
  nlohmann::json gaps = nlohmann::json::array(), pairs = nlohmann::json::array();
  for (const ShardGap& gap : summary.gaps)
    gaps.push_back({{"run", gap.run}, {"shard", gap.shard}, {"rows", gap.rows}, {"episodes", gap.episodes}});
  for (const auto& [pair, agreement] : rows.agreement)
    pairs.push_back(
        {{"nodes", {pair.first, pair.second}}, {"compared", agreement.compared}, {"different", agreement.different}});
  return {{"merged", summary.written ? nlohmann::json(to) : nlohmann::json(nullptr)},
          {"rows", rows.rows},
          {"folded", rows.folded},
          {"superseded", rows.superseded},
          {"errors", rows.errors},
          {"timeouts", rows.timeouts},
          {"torn", rows.torn},
          {"planned", summary.planned},
          {"missing", gaps},
          {"nodes", rows.of_node},
          {"pairs", pairs},
          {"violations", rows.violations},
          {"conflicts", rows.conflicts}};
}

void run_merge(Session& session, MergeArguments arguments) {
  arguments.options.argv = session.argv;
  const MergeSummary summary = merge_runs(arguments.runs, arguments.options);
  print(session, text_of(summary, arguments), json_of(summary, arguments));
  if (!summary.written) session.exit_code = kExitGate;
}

}  // namespace

void add_merge(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "merge",
                  "one run from several of one suite, each with policies of its own, or from the workers of a planned "
                  "one (exit code 1 where they disagree on an episode)",
                  "duet merge runs/mine runs/yours --output runs/ours\n"
                  "  duet merge runs/planned");
  auto arguments = std::make_shared<MergeArguments>();
  command->add_option("runs", arguments->runs, "run directories of one suite")->required();
  command->add_option("-o,--output", arguments->options.output,
                      "run directory to make (default: into the one run, which was planned)");
  command->add_option("--without-node", arguments->options.without_nodes,
                      "leave the rows of this node out (repeatable): one whose rows are not those of the others");
  command->callback([&session, arguments] { run_merge(session, *arguments); });
}

}  // namespace duet::cli
