// duet plan: a suite, or trainings, cut into shards for many machines.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <iterator>
#include <sstream>

#include "duet/app/certificate.h"
#include "duet/app/cli/arguments.h"
#include "duet/cluster/plan_run.h"
#include "duet/cluster/run_status.h"
#include "duet/cluster/work_shard.h"
#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/parts/cluster/part.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {
namespace {

struct PlanArguments {
  SuiteArguments suite;
  PlanOptions options;
  std::string output, shards = "auto", certificate;
  std::vector<std::string> costs;
  bool trainings = false;
};

std::int64_t shard_count(const std::string& text) {
  if (text == "auto") return 0;
  const std::optional<double> number = parse_number(text);
  require(number && *number >= 1.0 && *number <= 1.0e6 && *number == static_cast<double>(static_cast<int>(*number)),
          "--shards: expected 'auto' or a whole number of 1 to 1000000, found '{}'", text);
  return static_cast<std::int64_t>(*number);
}

void read_costs(const std::vector<std::string>& texts, std::map<std::string, double>& costs) {
  for (const std::string& text : texts) {
    const auto [name, value] = split_assignment(text);
    const std::optional<double> cost = parse_number(value);
    require(cost && *cost > 0.0 && *cost <= 1.0e6,
            "--cost: expected ENGINE/CONTROLLER=SECONDS above 0 to 1e6, found '{}'", text);
    costs[name] = *cost;
  }
}

nlohmann::json json_of(const ShardPlan& plan, const std::string& run) {
  nlohmann::json shards = nlohmann::json::array();
  for (const Shard& shard : plan.shards)
    shards.push_back({{"name", shard.name}, {"episodes", shard.episodes()}, {"cost_s", shard.cost}});
  return {{"run", run}, {"episodes", plan.episodes}, {"costs", plan.costs}, {"shards", shards}};
}

std::string text_of(const ShardPlan& plan, const std::string& run) {
  double least = plan.shards.front().cost, most = least, all = 0.0;
  for (const Shard& shard : plan.shards) {
    least = std::min(least, shard.cost);
    most = std::max(most, shard.cost);
    all += shard.cost;
  }
  const bool trainings = plan.kind == ShardPlan::Kind::kTrainings;
  std::string text =
      fmt::format("{}: {} {} in {} shards (0 to {}), {} of one core in all, {} to {} a shard\n", run, plan.episodes,
                  trainings ? "trainings" : "episodes", plan.shards.size(), plan.shards.size() - 1,
                  format_duration(all), format_duration(least), format_duration(most));
  for (const auto& [name, cost] : plan.costs)
    text += fmt::format("  {:<24} {:.4g} s of a core per second of motion\n", name, cost);
  const std::string path = shell_word(run), leave = trainings ? " --allow-programs" : "";
  return text + fmt::format("go on with `duet work {} --shard 0{}`, or `duet submit {} --slurm{}`\n", path, leave, path,
                            leave);
}

void plan_trainings_of(Session& session, const PlanArguments& arguments) {
  const ShardPlan plan =
      plan_trainings(parse_trainings(read_text(arguments.suite.suite), arguments.suite.suite), arguments.output);
  print(session, text_of(plan, arguments.output), json_of(plan, arguments.output));
}

void run_plan(Session& session, PlanArguments arguments) {
  catch_interrupts();
  if (arguments.trainings) return plan_trainings_of(session, arguments);
  const Suite suite = suite_of(arguments.suite);
  arguments.options.shards = shard_count(arguments.shards);
  read_costs(arguments.costs, arguments.options.costs);
  arguments.options.argv = session.argv;
  if (!arguments.certificate.empty())
    arguments.options.certificate = certificate_json(load_certificate(arguments.certificate));
  const StopToken stop(0.0, session.begin);
  Progress progress(session.progress());
  try {
    const PlanSummary summary = plan_run(suite, arguments.output, arguments.options, stop, progress);
    for (const std::string& warning : summary.warnings) warn(warning);
    if (summary.pilots > 0) note(session, fmt::format("{} episodes were run to measure costs", summary.pilots));
    print(session, text_of(summary.plan, arguments.output), json_of(summary.plan, arguments.output));
  } catch (const Stopped&) {
    note(session, "stopped; the same command goes on");
    session.exit_code = stop.end() == RunEnd::kInterrupted ? kExitInterrupted : kExitResumable;
  }
}

}  // namespace

void add_plan(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "plan",
                                  "cut a suite into shards that many machines run: prepares its clips, measures what "
                                  "an episode costs, and writes plan.json",
                                  "duet plan suites/core.yaml --output runs/core --shards auto\n"
                                  "  duet plan --trainings arms.yaml --output runs/arms");
  auto arguments = std::make_shared<PlanArguments>();
  arguments->options.threads = default_threads();
  add_suite_options(*command, arguments->suite);
  command->add_option("-o,--output", arguments->output, "run directory to make; every machine has to see it")
      ->required();
  command->add_option("--shards", arguments->shards, "how many, or auto: of about 4 minutes of a core each")
      ->capture_default_str();
  add_filters(*command, arguments->options.part);
  command->add_option("--cost", arguments->costs,
                      "ENGINE/CONTROLLER=SECONDS of a core per second of motion, which is not measured then "
                      "(repeatable)");
  command->add_option("--certificate", arguments->certificate,
                      "parity certificate of `duet validate`, kept with the results");
  command->add_flag("--trainings", arguments->trainings,
                    "the file is a list of trainings: a shard for each seed of each arm (docs/cluster.md)");
  add_threads(command, arguments->options.threads, "threads that prepare the clips");
  command->callback([&session, arguments] { run_plan(session, *arguments); });
}

// duet submit: a planned run on a Slurm cluster.

namespace {

struct SubmitArguments {
  std::string run, program;
  bool slurm = false, dry_run = false;
  SlurmOptions options;
};

// Workers would refuse what was not allowed; this says so before they are queued.
void check_programs(const SubmitArguments& arguments) {
  const ShardPlan plan = read_shard_plan(arguments.run);
  if (plan.kind == ShardPlan::Kind::kTrainings)
    return require_allowed(programs_of(plan, arguments.run), arguments.options.allow_programs);
  const std::string suite = arguments.run + "/suite.yaml";
  require_allowed(programs_of(parse_suite(load_run_head(arguments.run).info.suite_yaml, suite)),
                  arguments.options.allow_programs);
}

std::vector<std::string> words_of(const std::string& program) {
  std::istringstream text(program);
  return {std::istream_iterator<std::string>(text), {}};
}

void run_submit(Session& session, SubmitArguments arguments) {
  check_programs(arguments);
  arguments.options.program = words_of(arguments.program);
  if (arguments.options.program.empty())
    arguments.options.program = {std::filesystem::read_symlink("/proc/self/exe").string()};
  const RunStatus status = run_status(arguments.run);
  const SlurmJobs jobs = slurm_jobs(status, arguments.run, arguments.options);
  write_slurm_scripts(jobs, arguments.run);
  SlurmSubmission submitted;
  const bool submits = arguments.slurm && !arguments.dry_run && has_sbatch();
  if (submits) submitted = submit_slurm_jobs(jobs, status, arguments.run);
  std::string text = jobs.array_script + "\n";
  for (std::size_t i = 0; i < jobs.arrays.size(); ++i)
    text += fmt::format("# --array={} --export=ALL,DUET_OFFSET={}\n", jobs.arrays[i], jobs.offsets[i]);
  text += submits ? fmt::format("# submitted: jobs {}; merge: {}\n", fmt::join(submitted.jobs, ", "), submitted.merge)
                  : fmt::format("# written to {}/slurm, not submitted{}\n", arguments.run,
                                has_sbatch() ? "" : ": sbatch is not here");
  print(session, text,
        {{"run", arguments.run},
         {"scripts", {arguments.run + "/slurm/array.sh", arguments.run + "/slurm/merge.sh"}},
         {"arrays", jobs.arrays},
         {"offsets", jobs.offsets},
         {"submitted", submits},
         {"jobs", submitted.jobs},
         {"merge", submitted.merge}});
}

}  // namespace

void add_submit(CLI::App& app, Session& session) {
  CLI::App* command = add_command(app, session, "submit",
                                  "write and print the scripts that run a planned run on a cluster, of the shards that "
                                  "are not done; with --slurm, submit them where sbatch is",
                                  "duet submit runs/core --slurm --partition cpu --time 00:30:00");
  auto arguments = std::make_shared<SubmitArguments>();
  SlurmOptions& options = arguments->options;
  command->add_option("run", arguments->run, "run directory that `duet plan` made")->required();
  command->add_flag("--slurm", arguments->slurm, "an array of workers, and a job that merges when they have ended");
  command->add_flag("--dry-run", arguments->dry_run, "write and print the scripts, submit nothing");
  command->add_option("--partition", options.partition, "as sbatch takes it");
  command->add_option("--account", options.account, "as sbatch takes it");
  command->add_option("--qos", options.qos, "as sbatch takes it");
  command->add_option("--constraint", options.constraint, "as sbatch takes it: nodes of one kind of processor");
  command->add_option("--time", options.time, "of a worker; one that needs longer is put back and goes on")
      ->capture_default_str();
  command->add_option("--mem", options.memory, "of a worker, as sbatch takes it");
  command->add_option("--sbatch", options.more,
                      "a further option of sbatch, whole: --sbatch=--exclude=n7 (repeatable)");
  command->add_option("--set-up", options.set_up, "a line that the scripts run first: 'module load gcc' (repeatable)");
  command->add_option("--program", arguments->program,
                      "how the nodes call duet, words with spaces between them (default: this program's path)");
  add_allow_programs(*command, options.allow_programs);
  command->add_option("--at-once", options.at_once, "workers at the same time, 0 for no limit")
      ->check(CLI::Range(0, 1'000'000));
  command->add_option("--largest-array", options.largest_array, "shards of one array (MaxArraySize)")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  add_threads(command, options.threads, "of a worker");
  command->callback([&session, arguments] { run_submit(session, *arguments); });
}

}  // namespace duet::cli
