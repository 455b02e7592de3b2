#include "duet/training/clipped_objective.h"

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

constexpr float kFarthestAction = 4.0F;  // standard deviations
constexpr float kLargestLog = 10.0F;     // of a ratio: e^10 is beyond every clip, and finite

}  // namespace

float log_probability(const Eigen::VectorXf& inverse_std, float sum_log_std, const float* action, const float* mean) {
  float sum = -sum_log_std;
  for (Eigen::Index k = 0; k < inverse_std.size(); ++k) {
    const float z = (action[k] - mean[k]) * inverse_std[k];
    sum -= 0.5F * z * z;
  }
  return sum;
}

LikelihoodGradient likelihood_gradient(float action, float mean, float inverse_std) {
  const float z = std::clamp((action - mean) * inverse_std, -kFarthestAction, kFarthestAction);
  return {.z = z, .log_std = z * z - 1.0F};
}

float ratio_gradient(float log_ratio, float advantage, float clip) {
  const float ratio = std::exp(std::clamp(log_ratio, -kLargestLog, kLargestLog));
  const bool clipped = (advantage > 0.0F && ratio > 1.0F + clip) || (advantage < 0.0F && ratio < 1.0F - clip);
  return clipped ? 0.0F : -advantage * ratio;
}

std::vector<float> generalised_advantages(std::span<const StepWorth> steps, float last_value, double discount,
                                          double lambda) {
  const auto gamma = static_cast<float>(discount), decay = static_cast<float>(discount * lambda);
  std::vector<float> advantages(steps.size());
  float advantage = 0.0F, next = last_value;
  for (std::size_t i = steps.size(); i-- > 0;) {
    const StepWorth& step = steps[i];
    const float goes_on = step.ends ? 0.0F : 1.0F;
    advantage = step.reward + gamma * next * goes_on - step.value + decay * goes_on * advantage;
    advantages[i] = advantage;
    next = step.value;
  }
  return advantages;
}

}  // namespace duet
