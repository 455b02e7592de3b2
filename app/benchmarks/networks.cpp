// Benchmarks of networks: published policies and D-STAR.
#include <fmt/format.h>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/nn/dense_kernels.h"
#include "duet/nn/network.h"
#include "duet/policies/dstar/dstar_policy.h"
#include "duet/policies/dstar/network.h"

namespace duet {

// Published policies: one evaluation at batch 1, and what it costs above the bare matrix products of the same sizes.

namespace {

struct Layer {
  int inputs, outputs, times;
};

struct PublishedPolicy {
  const char* name;  // of a published controller
  double most_us;    // what it may cost; 0: no target
  std::vector<Layer> layers;
};

const std::vector<PublishedPolicy>& published_policies() {
  static const std::vector<PublishedPolicy> list = {
      {"homie",
       40.0,
       {{456, 256, 1}, {256, 256, 1}, {256, 35, 1}, {111, 512, 1}, {512, 256, 1}, {256, 256, 1}, {256, 12, 1}}},
      {"twist2",
       170.0,
       {{35, 60, 1},
        {60, 128, 1},
        {127, 60, 10},
        {240, 40, 4},
        {80, 20, 3},
        {60, 128, 1},
        {34, 256, 1},
        {256, 128, 1},
        {128, 128, 1},
        {511, 512, 1},
        {512, 512, 1},
        {512, 256, 1},
        {256, 128, 1},
        {128, 29, 1}}},
      {"playground", 0.0, {{103, 512, 1}, {512, 256, 1}, {256, 128, 1}, {128, 58, 1}}},
      {"rl_gym", 0.0, {{47, 256, 1}, {64, 256, 1}, {64, 32, 1}, {32, 12, 1}}},
  };
  return list;
}

// CPU seconds of one evaluation.
double network_seconds(Network& network, double seconds) {
  const std::vector<float> in(network.inputs()[0].size, 0.1F);
  std::vector<float> out(network.outputs()[0].size);
  const std::span<const float> inputs[] = {in};
  const std::span<float> outputs[] = {out};
  return best_call_seconds([&] { network.run(inputs, outputs); }, seconds);
}

// Eigen's products of the same sizes and nothing else, with weights of their own.
double bare_seconds(const std::vector<Layer>& layers, double seconds) {
  constexpr int kWidest = 2048;
  std::vector<std::vector<float>> weights;
  weights.reserve(layers.size());
  for (const Layer& layer : layers) weights.emplace_back(static_cast<size_t>(layer.inputs) * layer.outputs, 1e-3F);
  const std::vector<float> x(kWidest, 0.1F);
  std::vector<float> y(kWidest);
  const DenseKernels& kernels = dense_kernels();
  return best_call_seconds(
      [&] {
        for (size_t k = 0; k < layers.size(); ++k)
          for (int i = 0; i < layers[k].times; ++i)
            kernels.gemv(layers[k].outputs, layers[k].inputs, weights[k].data(), x.data(), nullptr, y.data());
      },
      seconds);
}

std::vector<BenchmarkFigure> time_policy(const PublishedPolicy& policy, const BenchmarkOptions& options) {
  const auto network = load_network(find_network(load_descriptor(policy.name)));
  const double ours = network_seconds(*network, options.seconds / 2);
  const double bare = bare_seconds(policy.layers, options.seconds / 2);
  const std::string name = fmt::format("nn/{}", policy.name);
  const BenchmarkFigure cost = policy.most_us > 0.0 ? at_most(name, 1e6 * ours, "us", policy.most_us)
                                                    : BenchmarkFigure{name, 1e6 * ours, "us", "", true};
  return {cost, {name + ":over_bare_products", ours / bare, "1", "", true}};
}

}  // namespace

void add_nn_benchmarks(std::vector<Benchmark>& list) {
  for (const PublishedPolicy& policy : published_policies())
    list.push_back({fmt::format("nn/{}", policy.name), "one evaluation of a published policy, one core",
                    [policy](const BenchmarkOptions& options) { return time_policy(policy, options); }});
}

// Inference of D-STAR: frames, language and noise to a plan, one core.

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
