// Benchmarks of motions: detectors, kinematics, metrics, PAIR.
#include <fmt/format.h>

#include <algorithm>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/retarget/solver/pair.h"
#include "duet/retarget/solver/pair_solver.h"
#include "duet/robots/kinematics.h"

namespace duet {

ConfusionTable detector_confusion(int clips_per_task, int threads, ThresholdSet set) {
  const std::span<const Task> tasks = all_tasks();
  const int count = static_cast<int>(tasks.size());
  std::vector<std::vector<char>> accepted(tasks.size() * static_cast<size_t>(clips_per_task),
                                          std::vector<char>(tasks.size()));
  parallel_for_each(static_cast<int>(accepted.size()), threads, [&](int i) {
    SynthesisOptions options;
    options.index = i % clips_per_task;
    const InteractionClip clip = synthesize(tasks[i / clips_per_task], options);
    const Agent partner = human_agent(clip.actor_motion().joints);
    const Agent performer = human_agent(clip.reactor_motion().joints);
    for (int j = 0; j < count; ++j)
      accepted[i][j] = detect(tasks[j], partner, performer, DetectorVersion::kRobot, set).success ? 1 : 0;
  });
  ConfusionTable table;
  table.clips = clips_per_task;
  table.rate.assign(tasks.size(), std::vector<double>(tasks.size(), 0.0));
  table.tasks = task_names(tasks);
  for (size_t i = 0; i < accepted.size(); ++i)
    for (int j = 0; j < count; ++j)
      table.rate[i / clips_per_task][j] += accepted[i][j] / static_cast<double>(clips_per_task);
  return table;
}

namespace {

std::vector<BenchmarkFigure> time_forward(const BenchmarkOptions& options) {
  constexpr int kCalls = 100;  // a batch: one call is short against the cost of a std::function
  const RobotModel robot = load_robot(default_card_path());
  Kinematics kinematics(robot);
  Eigen::VectorXd q = robot.neutral;
  const double seconds = best_call_seconds(
      [&] {
        for (int i = 0; i < kCalls; ++i) {
          q[0] = 1e-3 * i;
          kinematics.update(Pose(), q);
        }
      },
      options.seconds);
  return {at_most("kinematics/forward", 1e6 * seconds / kCalls, "us", 2.0)};
}

}  // namespace

void add_kinematics_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"kinematics/forward", "poses of all links of the G1", time_forward});
}

namespace {

std::vector<BenchmarkFigure> time_metrics(const BenchmarkOptions& options) {
  const RobotModel robot = load_robot(default_card_path());
  const PairedMotion motion = retarget(benchmark_clip(), robot);
  const double seconds = best_call_seconds([&] { retargeting_metrics(motion, robot); }, options.seconds);
  return {at_most("metrics/retargeting", 1e3 * seconds, "ms", 5.0)};
}

std::vector<BenchmarkFigure> time_detectors(const BenchmarkOptions& options) {
  const InteractionClip clip = benchmark_clip();
  const Agent a = human_agent(clip.a.joints);
  const Agent b = human_agent(clip.b.joints);
  const double seconds = best_call_seconds(
      [&] {
        for (const Task task : kPaperTasks) detect(task, a, b, DetectorVersion::kRobot);
      },
      options.seconds);
  return {at_most("metrics/detectors", 1e3 * seconds, "ms", 1.0)};
}

}  // namespace

void add_metrics_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"metrics/retargeting", "the 18 metrics on a clip of 1,007 frames", time_metrics});
  list.push_back({"metrics/detectors", "all six detectors on a clip of 1,007 frames", time_detectors});
}

namespace {

constexpr int kRounds = 40;  // of about 25 ms: the best one meets the least of other load

struct Kernel {
  const char* name;
  KernelKind kind;
  double target;  // frames/s on one core; 0 = none asked
};
constexpr Kernel kKernels[] = {{"scalar", KernelKind::kScalar, 0.0},
                               {"sse", KernelKind::kV2, 0.0},
                               {"avx2", KernelKind::kV3, 25000.0},
                               {"avx512", KernelKind::kV4, 40000.0}};

std::vector<BenchmarkFigure> time_kernel(const Kernel& kernel) {
  const std::vector<KernelKind> here = available_kernels();
  if (std::find(here.begin(), here.end(), kernel.kind) == here.end())
    throw MissingError(fmt::format("PAIR kernel '{}' does not run on this processor", kernel.name));
  const RobotModel robot = load_robot(default_card_path());
  PairOptions options;
  options.kernel = kernel.kind;
  const PairTiming timing =
      time_pair(benchmark_clip(), robot, options, kernel.kind == KernelKind::kScalar ? 1 : kRounds);
  const std::string name = fmt::format("pair/paper/{}", kernel.name);
  const BenchmarkFigure solver = kernel.target > 0.0 ? at_least(name, timing.solver, "frames/s", kernel.target)
                                                     : BenchmarkFigure{name, timing.solver, "frames/s", "", true};
  return {solver, {name + ":retarget", timing.whole, "frames/s", "", true}};
}

// The modes on the ground, and how L-BFGS compares with Adam on the paper's own objective in the same run.
std::vector<BenchmarkFigure> time_mode(PairMode mode, KernelKind kind, const std::string& name) {
  const RobotModel robot = load_robot(default_card_path());
  PairOptions options = pair_options_of(mode);
  options.kernel = kind;
  const PairTiming timing = time_pair(benchmark_clip(), robot, options, kRounds);
  std::vector<BenchmarkFigure> figures = {{name, timing.solver, "frames/s", "", true},
                                          {name + ":retarget", timing.whole, "frames/s", "", true}};
  if (mode != PairMode::kBest) return figures;
  PairOptions paper;
  paper.kernel = kind;
  const PairTiming adam = time_pair(benchmark_clip(), robot, paper, kRounds);
  const double adam_ends = retarget(benchmark_clip(), robot, paper).loss.at("total").back();
  figures.push_back({name + ":over_paper", timing.solver / adam.solver, "1", "", true});
  paper.optimizer = Optimizer::kLbfgs;
  const PairTiming lbfgs = time_pair(benchmark_clip(), robot, paper, kRounds);
  const double lbfgs_ends = retarget(benchmark_clip(), robot, paper).loss.at("total").back();
  figures.push_back({name + ":lbfgs_over_adam", lbfgs.solver / adam.solver, "1", "", true});
  figures.push_back({name + ":lbfgs_objective_over_adams", lbfgs_ends / adam_ends, "1", "", true});
  return figures;
}

// The paper's way on the same clip, and how many times our best kernel is faster in the same run.
std::vector<BenchmarkFigure> time_libtorch(const BenchmarkOptions&) {
  constexpr int kIterations = 8;  // of 200: each costs the same
  const RobotModel robot = load_robot(default_card_path());
  const InteractionClip clip = benchmark_clip();
  const double ours = time_pair(clip, robot, {}, kRounds).solver;
  const double theirs = libtorch_frames_per_second(clip, robot, kIterations);
  return {{"pair/paper/libtorch", theirs, "frames/s", "", true},
          at_least("pair/paper/libtorch:ours_over_libtorch", ours / theirs, "1", 100.0)};
}

}  // namespace

void add_pair_benchmarks(std::vector<Benchmark>& list) {
  for (const Kernel& kernel : kKernels) {
    const std::vector<KernelKind> here = available_kernels();
    if (std::find(here.begin(), here.end(), kernel.kind) == here.end()) continue;
    list.push_back({fmt::format("pair/paper/{}", kernel.name), "PAIR, 200 iterations, one core, 1,007 frames",
                    [kernel](const BenchmarkOptions&) { return time_kernel(kernel); }});
  }
  for (const PairMode mode : {PairMode::kGrounded, PairMode::kBest}) {
    const char* const name = mode == PairMode::kGrounded ? "grounded" : "best";
    for (const Kernel& kernel : kKernels) {
      const std::vector<KernelKind> here = available_kernels();
      if (kernel.kind == KernelKind::kScalar || std::find(here.begin(), here.end(), kernel.kind) == here.end())
        continue;
      const std::string id = fmt::format("pair/{}/{}", name, kernel.name);
      list.push_back({id, fmt::format("PAIR, mode {}, one core, 1,007 frames", name),
                      [mode, kernel, id](const BenchmarkOptions&) { return time_mode(mode, kernel.kind, id); }});
    }
  }
  if (libtorch_available())
    list.push_back({"pair/paper/libtorch", "the same problem in libtorch's autograd, one thread", time_libtorch});
}

}  // namespace duet
