#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>

#include "duet/cluster/run_status.h"
#include "duet/core/file_batch.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

void require_one_line(const std::string& text, const char* what) {
  require(text.find_first_of("\n\r") == std::string::npos, "{}: expected one line, found several", what);
}

// sbatch reads a line of its own as a shell does, but for what a backslash means.
std::string sbatch_word(const char* option, const std::string& value) {
  require_one_line(value, option);
  if (shell_word(value) == value) return value;
  const bool has_double = value.find('"') != std::string::npos, has_single = value.find('\'') != std::string::npos;
  require(value.find('\\') == std::string::npos && !(has_double && has_single),
          "{}: expected a text without a backslash and with one kind of quotes at most, found '{}'", option,
          excerpt(value));
  return has_double ? fmt::format("'{}'", value) : fmt::format("\"{}\"", value);
}

std::string sbatch_line(const char* option, const std::string& value) {
  return value.empty() ? "" : fmt::format("#SBATCH --{}={}\n", option, sbatch_word(option, value));
}

// The file for what jobs print, in the run's folder. A '%' in a name of a file is written twice.
std::string output_line(const std::string& run, const char* pattern) {
  std::string folder;
  for (const char c : (fs::path(run) / "slurm" / "").string()) folder += c == '%' ? std::string("%%") : std::string{c};
  return sbatch_line("output", folder + pattern);
}

std::string common_lines(const SlurmOptions& options) {
  return sbatch_line("partition", options.partition) + sbatch_line("account", options.account) +
         sbatch_line("qos", options.qos) + sbatch_line("constraint", options.constraint) +
         sbatch_line("time", options.time);
}

std::string set_up_lines(const SlurmOptions& options, const std::string& run) {
  require_one_line(run, "the run directory");
  const std::string program = shell_words(options.program);
  require_one_line(program, "--program");
  std::string text =
      "\n# What the site needs comes here: modules, a container, another place of the run on this node.\n"
      "#   module load gcc\n"
      "#   DUET='apptainer exec duet.sif duet'    # words with a space between them\n"
      "#   DUET_RUN=/scratch/$USER/run\n";
  for (const std::string& line : options.set_up) {
    require_one_line(line, "--set-up");
    text += line + "\n";
  }
  return text + fmt::format(
                    "if [ -n \"${{DUET:-}}\" ]; then read -ra duet <<<\"$DUET\"; else duet=({}); fi\n"
                    "run={}\nrun=${{DUET_RUN:-$run}}\n",
                    program, shell_word(run));
}

constexpr std::string_view kArrayBody = R"(
shard=$((SLURM_ARRAY_TASK_ID + ${DUET_OFFSET:-0}))
worker= limit= stopped=
pass_on() { stopped=1; [ -z "$worker" ] || kill -TERM "$worker" 2>/dev/null; }
trap pass_on TERM                        # scancel, a node that is drained, preemption
trap 'limit=1; pass_on' USR1             # the time limit is near: the worker stops, and the task is put back

for try in $(seq 24); do
  "${duet[@]}" work "$run" --shard "$shard" -j "$threads" --quiet $allow &
  worker=$!
  wait "$worker"; code=$?
  while [ "$code" -gt 128 ] && kill -0 "$worker" 2>/dev/null; do wait "$worker"; code=$?; done
  [ -z "$stopped" ] || [ "$code" -le 128 ] || code=75
  case $code in
    75) [ -z "$limit" ] || scontrol requeue "$SLURM_JOB_ID"; exit 75 ;;
    132 | 134 | 135 | 136 | 137 | 139) ;;  # the worker crashed: the next one goes on, and knows of it
    *) exit "$code" ;;
  esac
done
exit "$code"
)";

std::string array_script(const std::string& run, const SlurmOptions& options) {
  std::string text =
      "#!/bin/bash\n# A worker for each shard of a planned run. `duet submit --slurm` wrote this; it may be\n"
      "# edited and given to sbatch by hand: sbatch --array=0-9 array.sh\n";
  text += "#SBATCH --job-name=duet\n#SBATCH --requeue\n#SBATCH --open-mode=append\n#SBATCH --signal=B:USR1@60\n";
  text += output_line(run, "%A_%a.out");
  text += fmt::format("#SBATCH --ntasks=1\n#SBATCH --cpus-per-task={}\n", options.threads);
  text += common_lines(options) + sbatch_line("mem", options.memory);
  for (const std::string& option : options.more) {
    require_one_line(option, "--sbatch");
    text += fmt::format("#SBATCH {}\n", option);
  }
  text += set_up_lines(options, run);
  return text +
         fmt::format("threads={}\nallow={}\n", options.threads, options.allow_programs ? "--allow-programs" : "") +
         std::string(kArrayBody);
}

std::string merge_script(const std::string& run, const SlurmOptions& options) {
  std::string text =
      "#!/bin/bash\n# Merges what the workers have done. Runs when they have ended, whatever became of them.\n"
      "#SBATCH --job-name=duet-merge\n#SBATCH --ntasks=1\n#SBATCH --cpus-per-task=1\n";
  text += output_line(run, "merge.out") + common_lines(options);
  text += set_up_lines(options, run);
  return text + "exec \"${duet[@]}\" merge \"$run\"\n";
}

struct PipeCloser {
  int* status;
  void operator()(std::FILE* pipe) const { *status = ::pclose(pipe); }
};

// The output of a command; throws InputError where it fails.
std::string said_by(const std::string& command) {
  int status = 0;
  std::string said;
  {
    const std::unique_ptr<std::FILE, PipeCloser> pipe(::popen((command + " 2>&1").c_str(), "r"), PipeCloser{&status});
    if (!pipe) throw InputError(fmt::format("cannot start '{}'", command));
    std::array<char, 4096> buffer{};
    for (std::size_t n = 0; (n = std::fread(buffer.data(), 1, buffer.size(), pipe.get())) > 0;)
      said.append(buffer.data(), n);
  }
  while (!said.empty() && said.back() == '\n') said.pop_back();
  if (status != 0) throw InputError(fmt::format("sbatch refuses the job: {}", excerpt(said, kShownSentence)));
  return said;
}

// "123;cluster" of --parsable.
std::string job_id(const std::string& said) {
  const std::string id = said.substr(0, said.find(';'));
  if (id.empty() || id.find_first_not_of("0123456789") != std::string::npos)
    throw InputError(fmt::format("sbatch: expected the number of a job, found '{}'", excerpt(said)));
  return id;
}

}  // namespace

SlurmJobs slurm_jobs(const RunStatus& status, const std::string& run, const SlurmOptions& options) {
  SlurmJobs jobs;
  std::map<std::int64_t, std::vector<std::int64_t>> numbers;  // by offset
  for (const ShardStatus& shard : status.shards) {
    if (shard.state == ShardState::kDone) continue;
    const std::int64_t offset = shard.number / options.largest_array * options.largest_array;
    numbers[offset].push_back(shard.number - offset);
  }
  require(!numbers.empty(), "all shards are done: there is nothing to submit; `duet merge` makes the run of them");
  for (const auto& [offset, of_array] : numbers) {
    const std::string limit = options.at_once > 0 ? fmt::format("%{}", options.at_once) : "";
    jobs.arrays.push_back(ranges_text(of_array) + limit);
    jobs.offsets.push_back(offset);
  }
  const std::string place = fs::absolute(run).lexically_normal().string();
  jobs.array_script = array_script(place, options);
  jobs.merge_script = merge_script(place, options);
  return jobs;
}

void write_slurm_scripts(const SlurmJobs& jobs, const std::string& run) {
  FileBatch batch;
  batch.write(join_without_links(run, "slurm/array.sh"), jobs.array_script);
  batch.write(join_without_links(run, "slurm/merge.sh"), jobs.merge_script);
  batch.put_in_place();
}

bool has_sbatch() { return std::system("command -v sbatch >/dev/null 2>&1") == 0; }

SlurmSubmission submit_slurm_jobs(const SlurmJobs& jobs, const RunStatus& status, const std::string& run) {
  if (!has_sbatch())
    throw MissingError(
        "sbatch is not here: submit the scripts of the run's folder slurm/ where it is, or leave --slurm "
        "out to see them");
  SlurmSubmission submission;
  const fs::path folder = fs::absolute(run) / "slurm";
  for (std::size_t i = 0; i < jobs.arrays.size(); ++i)
    submission.jobs.push_back(
        job_id(said_by(fmt::format("sbatch --parsable --array={} --export=ALL,DUET_OFFSET={} {}", jobs.arrays[i],
                                   jobs.offsets[i], shell_word((folder / "array.sh").string())))));
  if (status.kind == ShardPlan::Kind::kEpisodes)
    submission.merge =
        job_id(said_by(fmt::format("sbatch --parsable --dependency=afterany:{} {}", fmt::join(submission.jobs, ":"),
                                   shell_word((folder / "merge.sh").string()))));
  return submission;
}

}  // namespace duet
