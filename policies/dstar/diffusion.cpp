#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/policies/dstar/network.h"

namespace duet {
namespace {

// Nichol and Dhariwal, "Improved denoising diffusion probabilistic models", eq. 17; x in [0, 1].
double squared_cosine(double x) {
  constexpr double kOffset = 0.008;
  const double cosine = std::cos((x + kOffset) / (1.0 + kOffset) * std::numbers::pi / 2.0);
  return cosine * cosine;
}

}  // namespace

std::vector<double> squared_cosine_alpha_bar(int steps) {
  constexpr double kLargestBeta = 0.999;
  require(steps > 0, "squared_cosine_alpha_bar: expected at least one step");
  std::vector<double> alpha_bar(static_cast<std::size_t>(steps));
  double product = 1.0;
  for (int t = 0; t < steps; ++t) {
    const double left = squared_cosine((t + 1.0) / steps) / squared_cosine(static_cast<double>(t) / steps);
    product *= 1.0 - std::min(1.0 - left, kLargestBeta);
    alpha_bar[static_cast<std::size_t>(t)] = product;
  }
  return alpha_bar;
}

std::vector<int> ddim_steps(int training_steps, int inference_steps) {
  require(inference_steps > 0 && inference_steps <= training_steps,
          "ddim_steps: expected from one step of inference to as many as of training");
  std::vector<int> steps(static_cast<std::size_t>(inference_steps));
  for (int i = 0; i < inference_steps; ++i) {
    const double share = inference_steps > 1 ? static_cast<double>(i) / (inference_steps - 1) : 0.0;
    steps[static_cast<std::size_t>(i)] = static_cast<int>(std::lround((training_steps - 1) * (1.0 - share)));
  }
  return steps;
}

}  // namespace duet
