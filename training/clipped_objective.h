// The pure sums of proximal policy optimisation: how likely an action was, how the clipped objective and the likelihood
// change with the policy, and what a step was worth. Source: Schulman et al., arXiv:1707.06347 (the objective) and
// arXiv:1506.02438 (the advantages).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace duet {

// Log-probability of an action under independent normal distributions, up to a constant. `action` and `mean` have as
// many numbers as `inverse_std`; `sum_log_std` is the sum of the logarithms of the standard deviations.
float log_probability(const Eigen::VectorXf& inverse_std, float sum_log_std, const float* action, const float* mean);

// How the log-probability of one number of an action changes with its mean and with the logarithm of its standard
// deviation. Beyond four standard deviations it changes no faster than there.
struct LikelihoodGradient {
  float z = 0.0F;        // standard deviations from the mean; times inverse_std it is the derivative by the mean
  float log_std = 0.0F;  // derivative by the logarithm of the standard deviation
};
LikelihoodGradient likelihood_gradient(float action, float mean, float inverse_std);

// Derivative of -min(r A, clamp(r, 1 - clip, 1 + clip) A) by log r: 0 where the minimum is the clipped one.
float ratio_gradient(float log_ratio, float advantage, float clip);

struct StepWorth {
  float reward = 0.0F;
  float value = 0.0F;  // that the critic gave the state before the step
  bool ends = false;   // the episode; what follows belongs to another
};

// Generalised advantages of consecutive steps of one environment; `last_value` is the critic's of the state after them.
std::vector<float> generalised_advantages(std::span<const StepWorth> steps, float last_value, double discount,
                                          double lambda);

}  // namespace duet
