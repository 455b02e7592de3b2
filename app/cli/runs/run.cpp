// duet run: a suite, rolled out into a run directory.
#include "duet/app/cli/runs/run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "duet/app/certificate.h"
#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/execution/report_content.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/report/ranking/leaderboard_rows.h"

namespace duet::cli {
namespace {

int exit_code(RunEnd end) {
  return end == RunEnd::kComplete ? kExitOk : end == RunEnd::kInterrupted ? kExitInterrupted : kExitResumable;
}

// `how`: the start of its episodes, and the partner.
std::string describe(const RunSummary& summary, const std::string& how, const std::string& output) {
  std::vector<std::string> outcomes;
  for (const auto& [outcome, count] : summary.outcomes) outcomes.push_back(fmt::format("{} {}", count, outcome));
  std::string text = fmt::format("{} of {} episodes in {} ({} were there, {} run now{}{}); {}\n",
                                 summary.already_there + summary.run, summary.planned, output, summary.already_there,
                                 summary.run, outcomes.empty() ? "" : ": ", fmt::join(outcomes, ", "), how);
  for (const auto* absent : {&summary.absent_engines, &summary.absent_controllers, &summary.absent_policies})
    for (const auto& [name, reason] : *absent)
      text += fmt::format("{}; its episodes are rows with outcome `unsupported`\n", reason);
  if (summary.decided.has_value()) text += decided_run_text(*summary.decided);
  if (summary.end != RunEnd::kComplete) text += "stopped early; the same command goes on where it stopped\n";
  return text;
}

// How long what was asked to stop may go on [s]; it listens every few milliseconds, but a network that loads or a file
// that is read does not.
constexpr double kGrace = 1.0;

// The folder is at any moment as good as after a kill: nothing that is finished is lost.
[[noreturn]] void end_at_once(RunEnd end) {
  print_error(
      "duet: stopped in the middle of a step that cannot be stopped; the same command goes on where it stopped\n");
  std::_Exit(exit_code(end));
}

}  // namespace

int exit_code(const RunSummary& summary) {
  if (summary.end != RunEnd::kComplete) return exit_code(summary.end);
  return has_faults(summary.outcomes) ? kExitErrors : kExitOk;
}

RunSummary run_watched(Suite suite, const RunArguments& arguments, Progress& progress) {
  const StopToken stop(arguments.options.time_limit, arguments.options.begin);
  const Watchdog watch(stop, kGrace, end_at_once);
  try {
    return run_suite(std::move(suite), arguments.output, arguments.options, progress);
  } catch (const StorageError& error) {
    throw StorageError(
        fmt::format("{}; the run has stopped and the same command goes on where it stopped", error.what()));
  }
}

namespace {

// A terminal that is gone does not change how a stopped run ends.
void print_result(const Session& session, RunEnd end, const std::string& text, const nlohmann::json& json) {
  try {
    print(session, text, json);
  } catch (const std::exception&) {
    if (end == RunEnd::kComplete) throw;
  }
}

// Prints what would be run, and which programs would be started.
void print_plan(const Session& session, const Suite& suite) {
  const std::string hash = suite_hash(suite);
  nlohmann::json programs = nlohmann::json::array();
  std::string text;
  for (const NamedProgram& program : programs_of(suite)) {
    programs.push_back(describe(program));
    text += fmt::format("\n# program: {}", describe(program));
  }
  print(session, fmt::format("{}# hash: {}{}", resolved_yaml(suite), hash, text),
        {{"suite", resolved_yaml(suite)}, {"hash", hash}, {"programs", programs}});
}

}  // namespace

void run_suite_command(Session& session, RunArguments arguments) {
  catch_interrupts();
  Suite suite = suite_of(arguments.suite);
  if (arguments.dry_run) {
    print_plan(session, suite);
    return;
  }
  require(!arguments.output.empty(), "--output is needed: the run directory");
  arguments.options.argv = session.argv;
  arguments.options.begin = session.begin;
  arguments.options.decide.min_effect = arguments.min_effect / 100.0;
  if (!arguments.certificate.empty())
    arguments.options.certificate = certificate_json(load_certificate(arguments.certificate));
  Progress progress(session.progress());
  const std::string how = fmt::format("start: {}, partner: {}", to_string(suite.start), to_string(suite.partner));
  const RunSummary summary = run_watched(std::move(suite), arguments, progress);
  session.exit_code = exit_code(summary);
  for (const std::string& warning : summary.warnings) warn(warning);
  warn_of_timeouts(summary.outcomes);
  if (!summary.first_error.empty()) warn(errors_sentence(summary.outcomes.at("error"), summary.first_error));
  note(session, describe(summary, how, arguments.output));
  Run run = open_run(arguments.output, RowExtent::kLean);
  std::vector<std::string> notes;
  if (std::string partial = completeness(run); !partial.empty()) notes.push_back(std::move(partial));
  add_row_notes(run.rows, notes);
  const RunTables tables = tables_of(std::exchange(run.rows, {}), run);
  const std::vector<std::string> file_notes = with_suite(tables.board.suite, notes);
  const std::vector<Analysis> analyses = run_analyses(tables, Extent::kRun);
  for (const std::string& fault : policy_fault_notes(tables.leaderboard)) warn(fault);
  nlohmann::json json = {{"run", arguments.output},
                         {"planned", summary.planned},
                         {"already_there", summary.already_there},
                         {"run_now", summary.run},
                         {"outcomes", summary.outcomes},
                         {"absent_engines", summary.absent_engines},
                         {"absent_controllers", summary.absent_controllers},
                         {"absent_policies", summary.absent_policies},
                         {"policy_faults", policy_fault_notes(tables.leaderboard)},
                         {"complete", summary.end == RunEnd::kComplete},
                         {"notes", file_notes}};
  if (summary.decided.has_value()) json["decision"] = decided_run_json(*summary.decided);
  add_analyses(analyses, json);
  const std::string text = arguments.tables ? with_notes("md", run_text(analyses), file_notes) + "\n" : "";
  print_result(session, summary.end, text + run_screen(tables, analyses, notes), json);
  suggest_next(session, summary.end == RunEnd::kComplete
                            ? fmt::format("duet report {} --replays 3", shell_word(arguments.output))
                            : shell_words(session.argv));
}

namespace {

// Three options of one question.
void add_until_decided(CLI::App& command, RunArguments& arguments) {
  DecisionOptions& decide = arguments.options.decide;
  CLI::Option* policies =
      command
          .add_option(
              "--until-decided", decide.policies,
              "A,B,...: run these policies, clip by clip, until A is better or worse than each of the others or "
              "the same within the margin; a test that may be looked at at any time")
          ->delimiter(',');
  command.add_option("--alpha", decide.alpha, "error of the decision, over all of its pairs")
      ->capture_default_str()
      ->check(CLI::Range(1.0e-6, 0.5))
      ->needs(policies);
  command.add_option("--min-effect", arguments.min_effect, "margin [points] within which two policies are the same")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 99.0))
      ->needs(policies);
}

// CLI::Range lets NaN through.
CLI::Validator time_limit_check() {
  return {[](const std::string& text) -> std::string {
            const std::optional<double> seconds = parse_number(text);
            if (seconds && *seconds >= 0.0 && *seconds <= 1.0e9) return "";
            return fmt::format("expected 0 to 1e9 s, found '{}'", text);
          },
          "0 to 1e9"};
}

}  // namespace

void add_time_limit(CLI::App& command, RunOptions& options) {
  command
      .add_option("--time-limit", options.time_limit, "of the command [s], 0 for none; stops resumable (exit code 75)")
      ->check(time_limit_check());
}

void add_run(CLI::App& app, Session& session) {
  CLI::App* command =
      add_command(app, session, "run", "roll a suite out in its engines, with the null arm; resumes by itself",
                  "duet run suites/core.yaml --output runs/core\n"
                  "  duet run suites/controllers.yaml --controllers homie --network homie=deploy.onnx -o runs/homie\n"
                  "  duet run suites/core.yaml --clips handshake_paired.npz --output runs/cmu");
  auto arguments = std::make_shared<RunArguments>();
  arguments->options.threads = default_threads();
  RunOptions& options = arguments->options;
  add_suite_options(*command, arguments->suite);
  command->add_option("-o,--output", arguments->output,
                      "run directory; an unfinished run of the same suite is resumed");
  command->add_option("--certificate", arguments->certificate,
                      "parity certificate of `duet validate`, kept with the results");
  add_filters(*command, options);
  add_until_decided(*command, *arguments);
  add_threads(command, options.threads);
  add_time_limit(*command, options);
  command->add_flag("--retry-errors", options.retry_errors,
                    "run episodes again that ended with an error; those that timed out always run again");
  command->add_flag("--tables", arguments->tables, "print every table before the verdict and the board");
  command->add_flag("--dry-run", arguments->dry_run,
                    "print the resolved suite, its hash and the programs that it would start; run nothing");
  command->callback([&session, arguments] { run_suite_command(session, *arguments); });
}

// duet walk: the suite `walk` for those who want to see whether a controller walks.

namespace {

struct WalkArguments {
  std::vector<double> velocity;
  double seconds = 0.0;
};

}  // namespace

void add_walk(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "walk", "does it walk, how fast, does it fall: the suite `walk`",
                                  "duet walk homie --network homie=homie_deploy.onnx\n"
                                  "  duet walk wbc_sim vmc --velocity 0.4,0,0 --engines mujoco,ode");
  auto arguments = std::make_shared<RunArguments>();
  auto walk = std::make_shared<WalkArguments>();
  arguments->suite.suite = "walk";
  arguments->output = "runs/walk";
  arguments->options.threads = default_threads();
  command->add_option("controllers", arguments->options.controllers, "only these (default: all of the suite)");
  command
      ->add_option("--velocity", walk->velocity, "forward, sideways [m/s], turn [rad/s] (default: the suite's three)")
      ->delimiter(',')
      ->expected(3);
  command->add_option("--seconds", walk->seconds, "how long; with --velocity")
      ->check(CLI::Range(1.0, 600.0))
      ->needs(command->get_option("--velocity"));
  command->add_option("--engines", arguments->options.engines, "only these")->delimiter(',');
  command->add_option("--network", arguments->suite.networks, "NAME=PATH: the network of a controller (repeatable)");
  command->add_option("-o,--output", arguments->output, "run directory")->capture_default_str();
  add_threads(command, arguments->options.threads);
  command->callback([&session, arguments, walk, command] {
    if (command->count("--output") == 0)
      note(session, fmt::format("writing to {} (--output names another folder)", arguments->output));
    if (!walk->velocity.empty())
      arguments->suite.overrides.push_back(
          fmt::format("reference={{velocity: [{}]{}}}", fmt::join(walk->velocity, ", "),
                      walk->seconds > 0.0 ? fmt::format(", seconds: {}", walk->seconds) : ""));
    run_suite_command(session, *arguments);
  });
}

}  // namespace duet::cli
