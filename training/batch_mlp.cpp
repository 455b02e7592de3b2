#include "duet/training/batch_mlp.h"

#include <cmath>

#include "duet/nn/dense_kernels.h"

namespace duet {

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

}  // namespace duet
