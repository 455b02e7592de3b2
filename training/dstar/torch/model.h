// D-STAR's arithmetic in libtorch, batched and differentiable: the same formulas as policies/dstar/denoiser.cpp, tensor
// by tensor (docs/file-formats.md). Weights by name.
#pragma once

#include <torch/torch.h>

#include <map>
#include <string>
#include <vector>

#include "duet/policies/dstar/network.h"
#include "duet/policies/language.h"
#include "duet/training/dstar/windows.h"

namespace duet {

using Weights = std::map<std::string, torch::Tensor>;

struct ModelInput {
  torch::Tensor frames;       // (B, 12, 149), normalised
  torch::Tensor past;         // likewise, of the long stream
  torch::Tensor position;     // (B, 144)
  torch::Tensor distance;     // (B, 6)
  torch::Tensor orientation;  // (B, 12)
  torch::Tensor language;     // (B, 768)
};

struct ModelCondition {
  torch::Tensor condition;     // (B, config.condition)
  torch::Tensor phase_logits;  // (B, 3); undefined without phase attention
};

ModelCondition encode(const DstarConfig& config, const Weights& weights, const ModelInput& input);
// Runs the phase classifier alone: for L_trans.
torch::Tensor classify(const DstarConfig& config, const Weights& weights, const ModelInput& input);
// x (B, 5, 36), step (B) -> x0 (B, 5, 36), normalised.
torch::Tensor denoise(const DstarConfig& config, const Weights& weights, const torch::Tensor& x,
                      const torch::Tensor& step, const torch::Tensor& condition);
// DDIM from x_T, eta 0.
torch::Tensor sample(const DstarConfig& config, const Weights& weights, const torch::Tensor& noise,
                     const torch::Tensor& condition);

// Between plain batches and tensors: normalisers, language, noise.

// A tensor over the matrix's own memory.
torch::Tensor view(Eigen::MatrixXf& matrix, at::IntArrayRef shape);
// Standard normal numbers.
torch::Tensor normal_noise(at::IntArrayRef shape, Random& random);

// The units of a network: what it sees of a batch, and what its plans mean.
class Units {
 public:
  Units(const WindowStatistics& statistics, const LanguageEncoder& encoder, bool leads);  // leads: see commands_of

  [[nodiscard]] ModelInput input(WindowBatch& batch) const;
  [[nodiscard]] torch::Tensor normalised(const torch::Tensor& plan) const { return (plan - mean_) / deviation_; }
  [[nodiscard]] torch::Tensor physical(const torch::Tensor& plan) const { return plan * deviation_ + mean_; }

 private:
  [[nodiscard]] torch::Tensor frames(Eigen::MatrixXf& raw) const;
  [[nodiscard]] torch::Tensor language(const WindowBatch& batch) const;

  torch::Tensor frame_mean_, frame_deviation_, mean_, deviation_;  // the last two (5, 36), of plans
  std::vector<std::vector<std::vector<float>>> prompts_;           // per task: commands_of
};

// All weights of a network in one run of numbers, with views by name: what Adam, the running average and checkpoints
// work on.
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
