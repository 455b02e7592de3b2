#include "duet/training/dstar/torch/weight_block.h"

#include <algorithm>
#include <cmath>

#include "duet/core/random.h"

namespace duet {
namespace {

constexpr double kPositionBound = 0.05, kBranchShare = 0.3;

double bound_of(const TensorShape& shape) {
  if (shape.name.ends_with("position")) return kPositionBound;
  const double inputs = static_cast<double>(WeightBlock::count(shape)) / static_cast<double>(shape.shape[0]);
  const bool last = shape.name.ends_with("conv2.weight") || shape.name.ends_with("film_condition.weight") ||
                    shape.name.ends_with("film_step.weight");
  return (last ? kBranchShare : 1.0) * std::sqrt(1.5 / inputs);
}

}  // namespace

WeightBlock::WeightBlock(const DstarConfig& config) : shapes_(dstar_tensors(config)) {
  std::size_t size = 0;
  for (const TensorShape& shape : shapes_) size += count(shape);
  values_.assign(size, 0.0F);
}

std::size_t WeightBlock::count(const TensorShape& shape) {
  std::size_t n = 1;
  for (const std::int64_t d : shape.shape) n *= static_cast<std::size_t>(d);
  return n;
}

Weights WeightBlock::views(bool learn) {
  Weights weights;
  float* at = values_.data();
  for (const TensorShape& shape : shapes_) {
    torch::Tensor view = torch::from_blob(at, shape.shape, torch::kFloat32);
    weights[shape.name] = learn ? view.requires_grad_(true) : view;
    at += count(shape);
  }
  return weights;
}

std::map<std::string, duet::Tensor> WeightBlock::tensors() const {
  std::map<std::string, duet::Tensor> result;
  const float* at = values_.data();
  for (const TensorShape& shape : shapes_) {
    result[shape.name] = {shape.shape, {at, at + count(shape)}};
    at += count(shape);
  }
  return result;
}

void WeightBlock::assign(const std::map<std::string, duet::Tensor>& tensors) {
  float* at = values_.data();
  for (const TensorShape& shape : shapes_) at = std::ranges::copy(tensors.at(shape.name).values, at).out;
}

void WeightBlock::initialise(std::uint64_t seed) {
  Random random(seed, stream_key({"dstar weights"}));
  float* at = values_.data();
  for (const TensorShape& shape : shapes_) {
    float* const end = at + count(shape);
    if (shape.name.ends_with(".bias")) {
      std::fill(at, end, 0.0F);
    } else if (shape.name.find("norm") != std::string::npos) {
      std::fill(at, end, 1.0F);
    } else {
      const double bound = bound_of(shape);
      std::generate(at, end, [&] { return static_cast<float>(random.uniform(-bound, bound)); });
    }
    at = end;
  }
}

}  // namespace duet
