#include "duet/nn/mlp.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/nn/dense_kernels.h"

namespace duet {
namespace {

int filled_up(Eigen::Index columns) {
  return static_cast<int>((columns + kHalfColumns - 1) / kHalfColumns) * kHalfColumns;
}

// Empty where a weight would change.
std::vector<std::uint16_t> in_half(const decltype(MlpLayer::W)& W) {
  const int columns = filled_up(W.cols());
  std::vector<std::uint16_t> halves(half_size(static_cast<int>(W.rows()), columns), 0);
  for (int row = 0; row < W.rows(); ++row)
    for (int c = 0; c < W.cols(); ++c) {
      const Eigen::half half(W(row, c));
      if (static_cast<float>(half) != W(row, c)) return {};
      halves[half_index(row, c, columns)] = half.x;
    }
  return halves;
}

}  // namespace

std::vector<int> Mlp::sizes() const {
  std::vector<int> sizes = {inputs()};
  for (const MlpLayer& layer : layers) sizes.push_back(static_cast<int>(layer.W.rows()));
  return sizes;
}

Mlp random_mlp(const std::vector<int>& sizes, float output_scale, Random& random) {
  Mlp mlp;
  for (size_t i = 0; i + 1 < sizes.size(); ++i) {
    MlpLayer layer;
    layer.W.resize(sizes[i + 1], sizes[i]);
    layer.b.setZero(sizes[i + 1]);
    const float scale = (i + 2 == sizes.size() ? output_scale : 1.3F) / std::sqrt(static_cast<float>(sizes[i]));
    for (Eigen::Index k = 0; k < layer.W.size(); ++k) layer.W.data()[k] = scale * static_cast<float>(random.normal());
    mlp.layers.push_back(std::move(layer));
  }
  return mlp;
}

MlpRunner::MlpRunner(const Mlp& mlp) : mlp_(mlp), input_(Eigen::VectorXf::Zero(filled_up(mlp.inputs()))) {
  for (const MlpLayer& layer : mlp.layers) {
    Layer& runs = layers_.emplace_back();
    runs.half = in_half(layer.W);
    runs.columns = runs.half.empty() ? static_cast<int>(layer.W.cols()) : filled_up(layer.W.cols());
    runs.value.setZero(filled_up(layer.W.rows()));
  }
}

std::span<const float> MlpRunner::run(std::span<const float> input) {
  const DenseKernels& kernels = dense_kernels();
  std::ranges::copy(input.first(static_cast<size_t>(mlp_.inputs())), input_.data());
  const float* x = input_.data();
  for (size_t i = 0; i < layers_.size(); ++i) {
    const MlpLayer& layer = mlp_.layers[i];
    Layer& runs = layers_[i];
    const int rows = static_cast<int>(layer.W.rows());
    float* y = runs.value.data();
    if (runs.half.empty())
      kernels.gemv(rows, runs.columns, layer.W.data(), x, layer.b.data(), y);
    else
      kernels.gemv_half(rows, runs.columns, runs.half.data(), x, layer.b.data(), y);
    if (i + 1 < layers_.size()) kernels.elu(rows, y);
    x = y;
  }
  return {x, static_cast<size_t>(mlp_.outputs())};
}

namespace {

const Tensor& tensor(const SafeTensors& tensors, const std::string& name, const std::string& file) {
  const auto found = tensors.tensors.find(name);
  if (found == tensors.tensors.end()) throw InputError(fmt::format("{}: no tensor '{}'", file, name));
  return found->second;
}

MlpLayer read_layer(const SafeTensors& tensors, const std::string& name, Eigen::Index inputs, const std::string& file) {
  const Tensor& weight = tensor(tensors, name + ".weight", file);
  const Tensor& bias = tensor(tensors, name + ".bias", file);
  if (weight.shape.size() != 2 || (inputs > 0 && weight.shape[1] != inputs))
    throw InputError(fmt::format("{}: tensor '{}.weight' has shape ({}), expected (outputs, {})", file, name,
                                 fmt::join(weight.shape, ", "), inputs > 0 ? std::to_string(inputs) : "inputs"));
  if (bias.shape.size() != 1 || bias.shape[0] != weight.shape[0])
    throw InputError(fmt::format("{}: tensor '{}.bias' has shape ({}), expected ({})", file, name,
                                 fmt::join(bias.shape, ", "), weight.shape[0]));
  MlpLayer layer;
  layer.W = Eigen::Map<const decltype(layer.W)>(weight.values.data(), weight.shape[0], weight.shape[1]);
  layer.b = Eigen::Map<const Eigen::VectorXf>(bias.values.data(), bias.shape[0]);
  if (!layer.W.allFinite() || !layer.b.allFinite())
    throw InputError(fmt::format("{}: tensor '{}.weight' or its bias has values that are not finite", file, name));
  return layer;
}

}  // namespace

void add_mlp(SafeTensors& tensors, const std::string& prefix, const Mlp& mlp) {
  for (size_t i = 0; i < mlp.layers.size(); ++i) {
    const MlpLayer& layer = mlp.layers[i];
    const std::string name = fmt::format("{}.{}", prefix, i);
    tensors.tensors[name + ".weight"] = {.shape = {layer.W.rows(), layer.W.cols()},
                                         .values = {layer.W.data(), layer.W.data() + layer.W.size()}};
    tensors.tensors[name + ".bias"] = {.shape = {layer.b.size()},
                                       .values = {layer.b.data(), layer.b.data() + layer.b.size()}};
  }
}

Mlp read_mlp(const SafeTensors& tensors, const std::string& prefix, const std::string& file) {
  Mlp mlp;
  for (int i = 0; i == 0 || tensors.tensors.contains(fmt::format("{}.{}.weight", prefix, i)); ++i)
    mlp.layers.push_back(
        read_layer(tensors, fmt::format("{}.{}", prefix, i), i == 0 ? 0 : mlp.layers.back().W.rows(), file));
  return mlp;
}

}  // namespace duet
