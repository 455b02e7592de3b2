#include "duet/nn/mlp.h"

#include <algorithm>
#include <cmath>

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

}  // namespace duet
