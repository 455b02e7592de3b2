// duet submit: a planned run on a Slurm cluster.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <iterator>
#include <sstream>

#include "duet/cluster/slurm_script.h"
#include "duet/cluster/training_jobs.h"
#include "duet/experiment/plan/trust.h"
#include "duet/parts/cluster/part.h"
#include "duet/rows/folder/run_directory.h"

namespace duet::cli {
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
