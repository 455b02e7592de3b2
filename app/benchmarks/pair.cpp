#include "duet/retarget/pair.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/app/benchmarks/parts.h"
#include "duet/core/require.h"
#include "duet/retarget/libtorch_peer.h"
#include "duet/retarget/pair_solver.h"

namespace duet {
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
