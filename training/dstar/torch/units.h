// Between plain batches and tensors: normalisers, language, noise.
#pragma once

#include <torch/torch.h>

#include <vector>

#include "duet/policies/language.h"
#include "duet/training/dstar/torch/model.h"
#include "duet/training/dstar/windows.h"

namespace duet {

// A tensor over the matrix's own memory.
torch::Tensor view(Eigen::MatrixXf& matrix, at::IntArrayRef shape);
// Standard normal numbers.
torch::Tensor normal_noise(at::IntArrayRef shape, Random& random);

// The units of a network: what it sees of a batch, and what its plans mean.
class Units {
 public:
  Units(const WindowStatistics& statistics, const LanguageEncoder& encoder);

  [[nodiscard]] ModelInput input(WindowBatch& batch) const;
  [[nodiscard]] torch::Tensor normalised(const torch::Tensor& plan) const { return (plan - mean_) / deviation_; }
  [[nodiscard]] torch::Tensor physical(const torch::Tensor& plan) const { return plan * deviation_ + mean_; }

 private:
  [[nodiscard]] torch::Tensor frames(Eigen::MatrixXf& raw) const;
  [[nodiscard]] torch::Tensor language(const WindowBatch& batch) const;

  torch::Tensor frame_mean_, frame_deviation_, mean_, deviation_;  // the last two (5, 36), of plans
  std::vector<std::vector<std::vector<float>>> prompts_;           // per task: the prompt, then its paraphrases
};

}  // namespace duet
