#include <fmt/format.h>

#include "duet/app/benchmarks/hardware.h"
#include "duet/app/benchmarks/hardware_wire.h"
#include "duet/app/benchmarks/parts.h"
#include "duet/motion/synthesis/synthesis.h"

namespace duet {

const std::vector<Benchmark>& benchmarks() {
  static const std::vector<Benchmark> list = [] {
    std::vector<Benchmark> all;
    add_pair_benchmarks(all);
    add_dataset_benchmarks(all);
    add_metrics_benchmarks(all);
    add_kinematics_benchmarks(all);
    add_backend_benchmarks(all);
    add_nn_benchmarks(all);
    add_policy_benchmarks(all);
    add_runner_benchmarks(all);
    add_scale_benchmarks(all);
    add_wbc_benchmarks(all);
    add_hardware_benchmarks(all);
    add_wire_benchmark(all);
    return all;
  }();
  return list;
}

BenchmarkFigure at_least(const std::string& name, double value, const std::string& unit, double target) {
  return {name, value, unit, fmt::format("at least {:g}", target), value >= target};
}

BenchmarkFigure at_most(const std::string& name, double value, const std::string& unit, double target) {
  return {name, value, unit, fmt::format("at most {:g}", target), value <= target};
}

InteractionClip benchmark_clip() {
  constexpr int kFrames = 1007;
  SynthesisOptions options;
  options.duration = 22.9;
  InteractionClip clip = synthesize(Task::kHandshake, options);
  const int surplus = clip.frames() - kFrames;
  clip.a = slice(clip.a, surplus / 2, surplus / 2 + kFrames);
  clip.b = slice(clip.b, surplus / 2, surplus / 2 + kFrames);
  clip.phases.act_begin = std::max(1, clip.phases.act_begin - surplus / 2);
  clip.phases.act_end = std::min(kFrames - 1, clip.phases.act_end - surplus / 2);
  clip.contacts.clear();
  return clip;
}

}  // namespace duet
