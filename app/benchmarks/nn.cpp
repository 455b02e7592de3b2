// Published policies: one evaluation at batch 1, and what it costs above the bare matrix products of the same sizes.
#include <fmt/format.h>

#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"
#include "duet/controllers/catalogue/published.h"
#include "duet/nn/dense_kernels.h"
#include "duet/nn/load_network.h"
#include "duet/nn/network.h"

namespace duet {
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

}  // namespace duet
