#include "retarget/pair.h"

#include <fmt/format.h>

#include <algorithm>

#include "bench/benchmarks/parts.h"
#include "core/require.h"
#include "retarget/libtorch_peer.h"
#include "retarget/pair_solver.h"

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

std::vector<Figure> time_kernel(const Kernel& kernel) {
  const std::vector<KernelKind> here = available_kernels();
  if (std::find(here.begin(), here.end(), kernel.kind) == here.end())
    throw MissingError(fmt::format("PAIR kernel '{}' does not run on this processor", kernel.name));
  const RobotModel robot = load_robot(default_card_path());
  PairOptions options;
  options.kernel = kernel.kind;
  const PairTiming timing =
      time_pair(benchmark_clip(), robot, options, kernel.kind == KernelKind::kScalar ? 1 : kRounds);
  const std::string name = fmt::format("pair/paper/{}", kernel.name);
  const Figure solver = kernel.target > 0.0 ? at_least(name, timing.solver, "frames/s", kernel.target)
                                            : Figure{name, timing.solver, "frames/s", "", true};
  return {solver, {name + ":retarget", timing.whole, "frames/s", "", true}};
}

// The paper's way on the same clip, and how many times our best kernel is faster in the same run.
std::vector<Figure> time_libtorch(const BenchmarkOptions&) {
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
  if (libtorch_available())
    list.push_back({"pair/paper/libtorch", "the same problem in libtorch's autograd, one thread", time_libtorch});
}

}  // namespace duet
