// D-STAR's arithmetic in libtorch, batched and differentiable: the same formulas as policies/dstar/runner.cpp, tensor
// by tensor (docs/file-formats.md). Weights by name.
#pragma once

#include <torch/torch.h>

#include <map>
#include <string>

#include "duet/policies/dstar/network.h"

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

}  // namespace duet
