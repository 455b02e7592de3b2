#include "duet/training/dstar/torch/device_network.h"

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

torch::Tensor on(torch::Device device, const float* values, int count) {
  return torch::from_blob(const_cast<float*>(values), {count}).clone().to(device);
}

void read_back(const torch::Tensor& run, float* out) {
  const torch::Tensor host = run.cpu().contiguous();
  std::copy_n(host.data_ptr<float>(), host.numel(), out);
}

}  // namespace

double AdamStep::corrected_rate() const { return rate / (1.0 - std::pow(0.9, static_cast<double>(number + 1))); }
double AdamStep::correction() const { return 1.0 - std::pow(0.999, static_cast<double>(number + 1)); }
double AdamStep::kept() const {
  const double t = static_cast<double>(number + 1);
  return std::min(average, (1.0 + t) / (10.0 + t));
}

DeviceNetwork::DeviceNetwork(const LearningState& state, torch::Device device)
    : shapes_(state.weights.shapes()),
      weights_(on(device, state.weights.data(), state.weights.size())),
      average_(on(device, state.average.data(), state.average.size())),
      m_(on(device, state.m.data(), state.weights.size())),
      v_(on(device, state.v.data(), state.weights.size())) {
  for (auto& [name, view] : views(weights_)) leaves_[name] = view.detach().requires_grad_(true);
}

Weights DeviceNetwork::views(const torch::Tensor& run) const {
  Weights weights;
  std::int64_t at = 0;
  for (const TensorShape& shape : shapes_) {
    const auto n = static_cast<std::int64_t>(WeightBlock::count(shape));
    weights[shape.name] = run.narrow(0, at, n).view(shape.shape);
    at += n;
  }
  return weights;
}

Weights DeviceNetwork::average() const { return views(average_); }

void DeviceNetwork::apply(const AdamStep& step) {
  const torch::NoGradGuard guard;
  std::vector<torch::Tensor> parts;
  for (const TensorShape& shape : shapes_) {
    torch::Tensor& gradient = leaves_.at(shape.name).mutable_grad();
    const auto n = static_cast<std::int64_t>(WeightBlock::count(shape));
    parts.push_back(gradient.defined() ? gradient.reshape({n}) : torch::zeros({n}, weights_.options()));
    gradient.reset();
  }
  torch::Tensor g = torch::cat(parts);
  g = g * (AdamStep::kNorm / g.norm()).clamp_max(1.0);
  m_.mul_(0.9).add_(g, 0.1);
  v_.mul_(0.999).addcmul_(g, g, 0.001);
  weights_.addcdiv_(m_, (v_ / step.correction()).sqrt().add_(1e-8), -step.corrected_rate());
  average_.mul_(step.kept()).add_(weights_, 1.0 - step.kept());
}

void DeviceNetwork::read(LearningState& state) const {
  read_back(weights_, state.weights.data());
  read_back(average_, state.average.data());
  read_back(m_, state.m.data());
  read_back(v_, state.v.data());
}

}  // namespace duet
