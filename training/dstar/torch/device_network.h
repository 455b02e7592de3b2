// A network that learns on a GPU: weights, moments of Adam and the running average live there as single runs of numbers
// in the order of WeightBlock, and come to the host for checkpoints alone.
#pragma once

#include "duet/training/dstar/torch/model.h"

namespace duet {

// The numbers that Adam, the running average and a checkpoint hold, on the host.
struct LearningState {
  WeightBlock weights, average;
  std::vector<float> m, v;  // moments of the gradient

  explicit LearningState(const DstarConfig& config)
      : weights(config), average(config), m(weights.size(), 0.0F), v(weights.size(), 0.0F) {}
};

// One step of Adam (beta .9 and .999) with the gradient's norm bounded, then of the running average.
struct AdamStep {
  static constexpr float kNorm = 5.0F;  // the gradient's bound

  long number = 0;       // of the step, from 0
  double rate = 0.0;     // before the correction of the moments' bias
  double average = 0.0;  // share of the average that is kept, at the most
  [[nodiscard]] double corrected_rate() const;
  [[nodiscard]] double correction() const;  // of the second moment
  [[nodiscard]] double kept() const;
};

class DeviceNetwork {
 public:
  DeviceNetwork(const LearningState& state, torch::Device device);

  [[nodiscard]] const Weights& leaves() const { return leaves_; }  // gather gradients
  [[nodiscard]] Weights average() const;
  void apply(const AdamStep& step);  // and clears the gradients
  void read(LearningState& state) const;

 private:
  [[nodiscard]] Weights views(const torch::Tensor& run) const;

  std::vector<TensorShape> shapes_;
  torch::Tensor weights_, average_, m_, v_;
  Weights leaves_;
};

}  // namespace duet
