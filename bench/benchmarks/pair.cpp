#include "retarget/pair.h"

#include <fmt/format.h>

#include <algorithm>

#include "bench/benchmarks/parts.h"
#include "core/require.h"
#include "retarget/pair_solver.h"

namespace duet {
namespace {

constexpr int kRounds = 10;

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

}  // namespace

void add_pair_benchmarks(std::vector<Benchmark>& list) {
  for (const Kernel& kernel : kKernels) {
    const std::vector<KernelKind> here = available_kernels();
    if (std::find(here.begin(), here.end(), kernel.kind) == here.end()) continue;
    list.push_back({fmt::format("pair/paper/{}", kernel.name), "PAIR, 200 iterations, one core, 1,007 frames",
                    [kernel](const BenchmarkOptions&) { return time_kernel(kernel); }});
  }
}

}  // namespace duet
