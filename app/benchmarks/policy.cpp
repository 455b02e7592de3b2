// Inference of D-STAR: frames, language and noise to a plan, one core.
#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"
#include "duet/core/random.h"
#include "duet/core/require.h"
#include "duet/policies/dstar/dstar_policy.h"
#include "duet/policies/dstar/random_network.h"

namespace duet {
namespace {

// The network that ships; where there is none, one of random weights and the same size: it takes the same time.
std::shared_ptr<const DstarNetwork> benchmark_network(const RobotModel& robot) {
  try {
    return load_dstar_network(dstar_files("dstar", {}).front().path, robot);
  } catch (const MissingError&) {
    return std::make_shared<const DstarNetwork>(random_dstar_network({}, robot, 1));
  }
}

std::vector<BenchmarkFigure> time_inference(const BenchmarkOptions& options) {
  const auto network = benchmark_network(*load_shared_robot());
  Random random(1, stream_key({"benchmark", "dstar"}));
  DstarFeatures features;
  const auto fill = [&random](auto&& values) {
    for (float& value : values) value = static_cast<float>(random.normal());
  };
  fill(features.frames.reshaped());
  fill(features.past.reshaped());
  fill(features.position);
  fill(features.orientation);
  features.distance << 0.2F, 0.5F, 0.9F, 1.0F, 1.2F, 1.5F;
  std::vector<float> language(static_cast<std::size_t>(network->config.language)), noise(kPlanSize);
  fill(language);
  fill(noise);
  DstarRunner runner(network);
  const double seconds = best_call_seconds(
      [&] { runner.run({.features = &features, .language = language, .noise = noise}); }, options.seconds);
  return {at_most("policy/dstar/inference", 1e3 * seconds, "ms", 10.0)};
}

}  // namespace

void add_policy_benchmarks(std::vector<Benchmark>& list) {
  list.push_back(
      {"policy/dstar/inference", "one plan of D-STAR: encoders and ten steps of DDIM, one core", time_inference});
}

}  // namespace duet
