#include "duet/execution/runner.h"

#include <algorithm>

#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"
#include "duet/core/scratch_folder.h"
#include "duet/experiment/suite/suite.h"

namespace duet {
namespace {

constexpr double kEpisodes = 48.0;  // 2 tasks x 12 clips x 2 arms
constexpr const char* kSuite = R"(
schema: duet.suite/1
name: bench-runner
version: 1.0.0
clips: {synth: {per_task: 12, seed: 42}}
tasks: [wave, high_five]
engines: [mujoco]
controllers: [vmc]
policies: [replay]
)";

// Wall time of the suite with a number of threads, in a folder that is removed again. [s]
double run_seconds(const Suite& suite, int threads) {
  const ScratchFolder folder;
  RunOptions options;
  options.threads = threads;
  Progress quiet(Progress::Style::kQuiet);
  const double begin = wall_seconds();
  run_suite(suite, folder / "run", options, quiet);
  return wall_seconds() - begin;
}

std::vector<BenchmarkFigure> time_suite_scaling(const BenchmarkOptions& options) {
  constexpr int kRounds = 2;
  const Suite suite = parse_suite(kSuite, "bench-runner");
  double one = 1e9, many = 1e9;
  for (int round = 0; round < kRounds; ++round) {
    one = std::min(one, run_seconds(suite, 1));
    many = std::min(many, run_seconds(suite, options.threads));
  }
  std::vector<BenchmarkFigure> figures;
  const std::string name = "runner/scaling";
  // The target is for two cores; with another number the figure is printed as it is.
  figures.push_back(options.threads == 2 ? at_least(name, one / many, "1", 1.9)
                                         : BenchmarkFigure{name, one / many, "1", "", true});
  figures.push_back({name + ":threads", static_cast<double>(options.threads), "1", "", true});
  figures.push_back({name + ":episodes_per_second", kEpisodes / many, "1/s", "", true});
  figures.push_back(at_most(name + ":peak_memory", peak_memory_mib(), "MiB", 1024.0));
  return figures;
}

}  // namespace

void add_runner_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"runner/scaling", "a suite of 48 episodes on all threads against one", time_suite_scaling});
}

}  // namespace duet
