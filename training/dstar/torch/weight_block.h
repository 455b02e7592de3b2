// All weights of a network in one run of numbers, with views by name: what Adam, the running average and checkpoints
// work on.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/training/dstar/torch/model.h"

namespace duet {

class WeightBlock {
 public:
  explicit WeightBlock(const DstarConfig& config);

  [[nodiscard]] int size() const { return static_cast<int>(values_.size()); }
  [[nodiscard]] float* data() { return values_.data(); }
  [[nodiscard]] const float* data() const { return values_.data(); }
  [[nodiscard]] const std::vector<TensorShape>& shapes() const { return shapes_; }
  static std::size_t count(const TensorShape& shape);

  // Tensors over the block's own memory; with `learn` as leaves that gather gradients.
  [[nodiscard]] Weights views(bool learn);
  [[nodiscard]] std::map<std::string, duet::Tensor> tensors() const;
  // Weights uniform within +-sqrt(1.5 / inputs), positions within +-0.05, biases 0, norms 1; what ends a residual
  // branch or steers one is smaller.
  void initialise(std::uint64_t seed);
  // Those of a network of the same configuration.
  void assign(const std::map<std::string, duet::Tensor>& tensors);

 private:
  std::vector<TensorShape> shapes_;
  std::vector<float> values_;
};

}  // namespace duet
