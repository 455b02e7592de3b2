#include "nn/mlp.h"

#include <cmath>

#include "nn/dense_kernels.h"

namespace duet {

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

MlpRunner::MlpRunner(const Mlp& mlp) : mlp_(mlp) {
  for (const MlpLayer& layer : mlp.layers) values_.emplace_back(layer.W.rows());
}

std::span<const float> MlpRunner::run(std::span<const float> input) {
  const DenseKernels& kernels = dense_kernels();
  const float* x = input.data();
  for (size_t i = 0; i < mlp_.layers.size(); ++i) {
    const MlpLayer& layer = mlp_.layers[i];
    const int rows = static_cast<int>(layer.W.rows());
    kernels.gemv(rows, static_cast<int>(layer.W.cols()), layer.W.data(), x, layer.b.data(), values_[i].data());
    if (i + 1 < mlp_.layers.size()) kernels.elu(rows, values_[i].data());
    x = values_[i].data();
  }
  return {values_.back().data(), static_cast<size_t>(values_.back().size())};
}

}  // namespace duet
