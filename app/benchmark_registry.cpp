#include <fmt/format.h>

#include <utility>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/app/part.h"
#include "duet/motion/synthesis/synthesis.h"

namespace duet {

namespace {

using AddBenchmarks = void (*)(std::vector<Benchmark>&);

// In the order in which they are printed; null: a part's.
constexpr std::pair<const char*, AddBenchmarks> kBenchmarks[] = {{"pair", add_pair_benchmarks},
                                                                 {"dataset", nullptr},
                                                                 {"metrics", add_metrics_benchmarks},
                                                                 {"kinematics", add_kinematics_benchmarks},
                                                                 {"backend", add_backend_benchmarks},
                                                                 {"nn", add_nn_benchmarks},
                                                                 {"policy", add_policy_benchmarks},
                                                                 {"runner", add_runner_benchmarks},
                                                                 {"scale", nullptr},
                                                                 {"wbc", nullptr},
                                                                 {"hardware", nullptr}};

}  // namespace

const std::vector<Benchmark>& benchmarks() {
  static const std::vector<Benchmark> list = [] {
    std::vector<Benchmark> all;
    for (const auto& [name, own] : kBenchmarks)
      if (const AddBenchmarks add = own != nullptr ? own : in_parts(&Part::benchmarks, name)) add(all);
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
