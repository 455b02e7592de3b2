#include "duet/training/agent.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/controllers/wbc_sim/wbc_sim.h"
#include "duet/core/require.h"
#include "duet/nn/dense_kernels.h"

namespace duet {
namespace {

constexpr const char* kCheckpointFormat = "duet.wbc-checkpoint/1";

std::vector<Eigen::Map<Eigen::VectorXf>> parameters_of(WbcAgent& agent) {
  auto parameters = flat_views(agent.actor.layers);
  const auto critic = flat_views(agent.critic.layers);
  parameters.insert(parameters.end(), critic.begin(), critic.end());
  parameters.emplace_back(agent.log_std.data(), agent.log_std.size());
  return parameters;
}

}  // namespace

WbcAgent make_agent(int actor_inputs, int critic_inputs, int actions, double std, std::uint64_t seed) {
  Random random(seed, stream_key({"wbc weights"}));
  WbcAgent agent;
  agent.actor = random_mlp({actor_inputs, 512, 256, 128, actions}, 0.05F, random);
  agent.critic = random_mlp({critic_inputs, 512, 256, 128, 1}, 1.0F, random);
  agent.log_std = Eigen::VectorXf::Constant(actions, static_cast<float>(std::log(std)));
  agent.actor_input = Normaliser(actor_inputs);
  agent.critic_input = Normaliser(critic_inputs);
  return agent;
}

SafeTensors to_tensors(const TrainingState& state) {
  SafeTensors tensors;
  add_mlp(tensors, "actor", state.agent.actor);
  add_mlp(tensors, "critic", state.agent.critic);
  tensors.tensors["log_std"] = tensor_of(state.agent.log_std);
  add_normaliser(tensors, "actor_input", state.agent.actor_input);
  add_normaliser(tensors, "critic_input", state.agent.critic_input);
  add_adam(tensors, state.adam);
  tensors.metadata["format"] = kCheckpointFormat;
  tensors.metadata["rate"] = fmt::format("{}", state.rate);
  tensors.metadata["iteration"] = std::to_string(state.iteration);
  tensors.metadata["steps"] = std::to_string(state.steps);
  if (state.critic_alone > 0) tensors.metadata["critic_alone"] = std::to_string(state.critic_alone);
  tensors.metadata["minutes"] = fmt::format("{}", state.minutes);
  tensors.metadata["stage"] = state.stage;
  tensors.metadata["robot_digest"] = state.robot_digest;
  tensors.metadata["seed"] = std::to_string(state.seed);
  return tensors;
}

TrainingState training_state(const SafeTensors& tensors, const std::string& file) {
  expect_text(tensors, "format", kCheckpointFormat, file);
  TrainingState state;
  state.agent.actor = read_mlp(tensors, "actor", file);
  state.agent.critic = read_mlp(tensors, "critic", file);
  state.agent.log_std = vector_of(tensors, "log_std", state.agent.actor.outputs(), file);
  state.agent.actor_input = normaliser_of(tensors, "actor_input", state.agent.actor.inputs(), file);
  state.agent.critic_input = normaliser_of(tensors, "critic_input", state.agent.critic.inputs(), file);
  state.adam = adam_of(tensors, parameters_of(state.agent), file);
  state.rate = number_of(tensors, "rate", file);
  state.iteration = std::lround(number_of(tensors, "iteration", file));
  state.steps = std::lround(number_of(tensors, "steps", file));
  if (tensors.metadata.contains("critic_alone"))
    state.critic_alone = std::lround(number_of(tensors, "critic_alone", file));
  state.minutes = number_of(tensors, "minutes", file);
  state.stage = text_of(tensors, "stage", file);
  state.robot_digest = text_of(tensors, "robot_digest", file);
  state.seed = static_cast<std::uint64_t>(number_of(tensors, "seed", file));
  return state;
}

BatchMlp::BatchMlp(const Mlp& mlp)
    : mlp_(mlp), values_(mlp.layers.size() + 1), deltas_(mlp.layers.size() + 1), gradient_(mlp.layers) {}

// A row-major (out, in) matrix is to the kernels a column-major (in, out) one.
const Eigen::MatrixXf& BatchMlp::forward(const Eigen::MatrixXf& x) {
  const DenseKernels& kernels = dense_kernels();
  const int n = static_cast<int>(x.cols());
  values_[0] = x;
  for (size_t i = 0; i < mlp_.layers.size(); ++i) {
    const MlpLayer& layer = mlp_.layers[i];
    const int out = static_cast<int>(layer.W.rows()), in = static_cast<int>(layer.W.cols());
    Eigen::MatrixXf& y = values_[i + 1];
    y.resize(out, n);
    y.colwise() = layer.b;  // not replicate(), which divides for every element
    kernels.gemm(true, false, out, n, in, layer.W.data(), values_[i].data(), y.data(), true);
    if (i + 1 < mlp_.layers.size()) kernels.elu(static_cast<int>(y.size()), y.data());
  }
  return values_.back();
}

void BatchMlp::backward(const Eigen::MatrixXf& d) {
  const DenseKernels& kernels = dense_kernels();
  const int n = static_cast<int>(d.cols());
  deltas_.back() = d;
  for (size_t i = mlp_.layers.size(); i-- > 0;) {
    const MlpLayer& layer = mlp_.layers[i];
    const int out = static_cast<int>(layer.W.rows()), in = static_cast<int>(layer.W.cols());
    const Eigen::MatrixXf& delta = deltas_[i + 1];
    kernels.gemm(false, true, in, out, n, values_[i].data(), delta.data(), gradient_[i].W.data(), false);
    gradient_[i].b = delta.rowwise().sum();
    if (i == 0) break;
    deltas_[i].resize(in, n);
    kernels.gemm(false, false, in, n, out, layer.W.data(), delta.data(), deltas_[i].data(), false);
    kernels.elu_backward(static_cast<int>(deltas_[i].size()), values_[i].data(), deltas_[i].data());
  }
}

std::vector<Eigen::Map<Eigen::VectorXf>> flat_views(std::vector<MlpLayer>& layers) {
  std::vector<Eigen::Map<Eigen::VectorXf>> views;
  for (MlpLayer& layer : layers) {
    views.emplace_back(layer.W.data(), layer.W.size());
    views.emplace_back(layer.b.data(), layer.b.size());
  }
  return views;
}

void Adam::step(std::vector<Eigen::Map<Eigen::VectorXf>>& parameters,
                std::vector<Eigen::Map<Eigen::VectorXf>>& gradients, double rate, double largest_norm) {
  if (m.empty())
    for (const auto& p : parameters) {
      m.emplace_back(Eigen::VectorXf::Zero(p.size()));
      v.emplace_back(Eigen::VectorXf::Zero(p.size()));
    }
  double squared = 0.0;
  for (const auto& g : gradients) squared += static_cast<double>(g.squaredNorm());
  const double norm = std::sqrt(squared), scale = norm > largest_norm ? largest_norm / norm : 1.0;
  ++steps;
  const auto step = static_cast<float>(rate / (1.0 - std::pow(0.9, static_cast<double>(steps))));
  const auto correction = static_cast<float>(1.0 - std::pow(0.999, static_cast<double>(steps)));
  for (size_t i = 0; i < parameters.size(); ++i)
    dense_kernels().adam(static_cast<int>(parameters[i].size()), gradients[i].data(), static_cast<float>(scale), step,
                         correction, m[i].data(), v[i].data(), parameters[i].data());
}

namespace {

constexpr float kLeastDeviation = 1e-2F;

}  // namespace

void Normaliser::update(const Eigen::MatrixXf& x) {
  Normaliser batch(static_cast<int>(x.rows()));
  batch.mean = x.rowwise().mean();
  batch.variance = (x.colwise() - batch.mean).array().square().rowwise().mean();
  batch.count = static_cast<double>(x.cols());
  merge(batch);
}

void Normaliser::merge(const Normaliser& other) {
  const double total = count + other.count;
  if (total <= 0.0) return;
  const Eigen::VectorXf delta = other.mean - mean;
  const auto share = static_cast<float>(other.count / total), rest = static_cast<float>(count / total);
  mean += share * delta;
  variance = rest * variance + share * other.variance + rest * share * delta.cwiseAbs2();
  count = total;
}

Eigen::VectorXf Normaliser::deviation() const { return variance.cwiseSqrt().array() + kLeastDeviation; }

void Normaliser::set_deviation(const Eigen::VectorXf& deviation) {
  variance = (deviation.array() - kLeastDeviation).max(0.0F).square();
}

void Normaliser::apply(Eigen::MatrixXf& x) const {
  const Eigen::ArrayXf inverse = deviation().cwiseInverse();
  x.colwise() -= mean;
  x = (x.array().colwise() * inverse).cwiseMin(kNormalClip).cwiseMax(-kNormalClip).eval();
}

void add_normaliser(SafeTensors& tensors, const std::string& prefix, const Normaliser& normaliser) {
  tensors.tensors[prefix + ".mean"] = tensor_of(normaliser.mean);
  tensors.tensors[prefix + ".variance"] = tensor_of(normaliser.variance);
  tensors.metadata[prefix + ".count"] = fmt::format("{}", normaliser.count);
}

Normaliser normaliser_of(const SafeTensors& tensors, const std::string& prefix, int size, const std::string& file) {
  Normaliser normaliser(size);
  normaliser.mean = vector_of(tensors, prefix + ".mean", size, file);
  normaliser.variance = vector_of(tensors, prefix + ".variance", size, file);
  normaliser.count = number_of(tensors, prefix + ".count", file);
  return normaliser;
}

void add_adam(SafeTensors& tensors, const Adam& adam) {
  for (size_t i = 0; i < adam.m.size(); ++i) {
    tensors.tensors[fmt::format("adam.{:02}.m", i)] = tensor_of(adam.m[i]);
    tensors.tensors[fmt::format("adam.{:02}.v", i)] = tensor_of(adam.v[i]);
  }
  tensors.metadata["adam.steps"] = std::to_string(adam.steps);
}

Adam adam_of(const SafeTensors& tensors, const std::vector<Eigen::Map<Eigen::VectorXf>>& parameters,
             const std::string& file) {
  Adam adam;
  adam.steps = std::lround(number_of(tensors, "adam.steps", file));
  for (size_t i = 0; adam.steps > 0 && i < parameters.size(); ++i) {
    adam.m.push_back(vector_of(tensors, fmt::format("adam.{:02}.m", i), parameters[i].size(), file));
    adam.v.push_back(vector_of(tensors, fmt::format("adam.{:02}.v", i), parameters[i].size(), file));
  }
  return adam;
}

}  // namespace duet
