#include "duet/policies/dstar/tensors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>

namespace duet {
namespace {

// Collects names and shapes in the order of the network's own arithmetic.
class Shapes {
 public:
  void tensor(const std::string& name, std::vector<std::int64_t> shape) { list.push_back({name, std::move(shape)}); }
  void linear(const std::string& name, int inputs, int outputs) {
    tensor(name + ".weight", {outputs, inputs});
    tensor(name + ".bias", {outputs});
  }
  void norm(const std::string& name, int channels) {
    tensor(name + ".weight", {channels});
    tensor(name + ".bias", {channels});
  }
  void convolution(const std::string& name, int channels) {
    tensor(name + ".weight", {channels, channels, 3});
    tensor(name + ".bias", {channels});
  }
  std::vector<TensorShape> list;
};

void add_stream(Shapes& shapes, const DstarConfig& config, const std::string& name, int frames) {
  const int width = config.width;
  shapes.linear(name + ".in", kFrameSize, width);
  shapes.tensor(name + ".position", {frames, width});
  for (int l = 0; l < config.layers; ++l) {
    const std::string layer = fmt::format("{}.{}", name, l);
    shapes.norm(layer + ".norm1", width);
    shapes.linear(layer + ".qkv", width, 3 * width);
    shapes.linear(layer + ".out", width, width);
    shapes.norm(layer + ".norm2", width);
    shapes.linear(layer + ".up", width, config.feedforward);
    shapes.linear(layer + ".down", config.feedforward, width);
  }
  shapes.norm(name + ".norm", width);
  shapes.linear(name + ".head", width, config.stream);
}

void add_phase(Shapes& shapes, const DstarConfig& config) {
  shapes.linear("phase.classify1", config.temporal, config.phase_hidden);
  shapes.linear("phase.classify2", config.phase_hidden, kPhases);
  for (int i = 0; i < kPhases; ++i)
    shapes.linear(fmt::format("phase.expert.{}", i), config.temporal, 3 * config.temporal);
  shapes.linear("phase.out", config.temporal, config.phase);
}

void add_spatial(Shapes& shapes, const DstarConfig& config) {
  for (int z = 0; z < kZones; ++z) {
    shapes.linear(fmt::format("spatial.zone.{}.1", z), 1, config.zone);
    shapes.linear(fmt::format("spatial.zone.{}.2", z), config.zone, config.zone);
  }
  shapes.linear("spatial.orientation", kOrientationSize, config.orientation);
  shapes.linear("spatial.field1", kPositionSize + kRelations * config.zone + config.orientation, config.field_hidden);
  shapes.linear("spatial.field2", config.field_hidden, config.field);
  shapes.linear("spatial.temporal", config.temporal, config.field);
  shapes.linear("spatial.fusion.qkv", config.field, 3 * config.field);
  shapes.linear("spatial.fusion.out", config.field, config.field);
  shapes.linear("spatial.out", 2 * config.field, config.spatial);
}

void add_denoiser(Shapes& shapes, const DstarConfig& config) {
  const int channels = config.channels;
  shapes.linear("denoise.in", kAnchorSize, channels);
  shapes.tensor("denoise.position", {kAnchors, channels});
  for (int b = 0; b < config.blocks; ++b) {
    const std::string block = fmt::format("denoise.{}", b);
    shapes.norm(block + ".norm1", channels);
    shapes.convolution(block + ".conv1", channels);
    shapes.norm(block + ".norm2", channels);
    shapes.linear(block + ".film_condition", config.condition, 2 * channels);
    shapes.tensor(block + ".film_step.weight", {2 * channels, config.condition});
    shapes.convolution(block + ".conv2", channels);
  }
  shapes.norm("denoise.norm", channels);
  shapes.linear("denoise.out", channels, kAnchorSize);
}

std::string size_problem(const char* what, Eigen::Index expected, Eigen::Index found) {
  return expected == found ? "" : fmt::format("{}: expected {} values, found {}", what, expected, found);
}

std::string normaliser_problem(const char* name, const Eigen::VectorXf& mean, const Eigen::VectorXf& deviation,
                               Eigen::Index size) {
  if (mean.size() != size) return size_problem(fmt::format("mean of {}", name).c_str(), size, mean.size());
  if (deviation.size() != size)
    return size_problem(fmt::format("deviation of {}", name).c_str(), size, deviation.size());
  for (Eigen::Index i = 0; i < size; ++i)
    if (!(deviation[i] > 0.0F))
      return fmt::format("deviation of {}: expected positive numbers, found {} at {}", name, deviation[i], i);
  return mean.allFinite() && deviation.allFinite() ? "" : fmt::format("normaliser of {} is not finite", name);
}

std::string weights_problem(const DstarNetwork& network) {
  std::set<std::string> known;
  for (const TensorShape& expected : dstar_tensors(network.config)) {
    known.insert(expected.name);
    const auto found = network.weights.find(expected.name);
    if (found == network.weights.end()) return fmt::format("expected a tensor '{}', found none", expected.name);
    std::size_t count = 1;
    for (const std::int64_t size : expected.shape) count *= static_cast<std::size_t>(size);
    if (found->second.shape != expected.shape || found->second.values.size() != count)
      return fmt::format("tensor '{}': expected shape {}, found {} with {} values", expected.name,
                         shape_words(expected.shape), shape_words(found->second.shape), found->second.values.size());
  }
  for (const auto& [name, tensor] : network.weights)
    if (!known.contains(name)) return fmt::format("tensor '{}' is not one of this configuration", name);
  return "";
}

}  // namespace

std::vector<TensorShape> dstar_tensors(const DstarConfig& config) {
  Shapes shapes;
  add_stream(shapes, config, "long", config.long_frames);
  if (config.short_stream) add_stream(shapes, config, "short", config.short_frames);
  shapes.linear("temporal", config.stream * (config.short_stream ? 2 : 1), config.temporal);
  if (config.phase_attention) add_phase(shapes, config);
  if (config.spatial_reasoning) add_spatial(shapes, config);
  shapes.linear("condition.1", config.condition_inputs(), config.condition);
  shapes.linear("condition.2", config.condition, config.condition);
  shapes.linear("step.1", config.step_embedding, config.condition);
  shapes.linear("step.2", config.condition, config.condition);
  add_denoiser(shapes, config);
  return shapes.list;
}

std::string network_problem(const DstarNetwork& network) {
  constexpr int kJoints = kAnchorSize - 7;
  std::string problem = config_problem(network.config);
  if (problem.empty()) problem = size_problem("joints", kJoints, static_cast<Eigen::Index>(network.joints.size()));
  if (problem.empty())
    problem = size_problem("channels", kFrameSize, static_cast<Eigen::Index>(network.channels.size()));
  if (problem.empty()) problem = normaliser_problem("frames", network.frame_mean, network.frame_deviation, kFrameSize);
  if (problem.empty()) problem = normaliser_problem("plans", network.plan_mean, network.plan_deviation, kPlanSize);
  return problem.empty() ? weights_problem(network) : problem;
}

std::string shape_words(const std::vector<std::int64_t>& shape) { return fmt::format("({})", fmt::join(shape, ", ")); }

}  // namespace duet
