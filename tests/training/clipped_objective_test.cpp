#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "duet/training/ppo.h"

namespace duet {
namespace {

constexpr float kClip = 0.2F;
constexpr double kStep = 1e-2;        // of a central difference in single precision
constexpr double kDifference = 2e-3;  // what its rounding leaves

double log_probability_of(float action, float mean, double log_std) {
  const Eigen::VectorXf inverse_std = Eigen::VectorXf::Constant(1, static_cast<float>(std::exp(-log_std)));
  return log_probability(inverse_std, static_cast<float>(log_std), &action, &mean);
}

TEST(LogProbability, IsThatOfTheNormalDistributionButForTheConstant) {
  const Eigen::Vector3f std(0.5F, 1.0F, 2.0F), action(0.1F, -0.4F, 3.0F), mean(0.3F, 0.0F, 1.0F);
  double expected = 0.0;
  for (int k = 0; k < 3; ++k)
    expected += -0.5 * std::pow((action[k] - mean[k]) / std[k], 2) - std::log(static_cast<double>(std[k]));
  EXPECT_NEAR(log_probability(std.cwiseInverse(), std.array().log().sum(), action.data(), mean.data()), expected, 1e-5);
}

TEST(LikelihoodGradient, IsTheDerivativeByMeanAndLogStd) {
  for (const float mean : {-1.2F, -0.1F, 0.0F, 0.7F})
    for (const double log_std : {-0.7, 0.0, 0.4}) {
      const float action = 0.3F, inverse_std = static_cast<float>(std::exp(-log_std));
      const LikelihoodGradient by = likelihood_gradient(action, mean, inverse_std);
      const auto h = static_cast<float>(kStep);
      EXPECT_NEAR(
          by.z * inverse_std,
          (log_probability_of(action, mean + h, log_std) - log_probability_of(action, mean - h, log_std)) / (2 * h),
          kDifference * (1.0 + std::abs(by.z)));
      EXPECT_NEAR(
          by.log_std,
          (log_probability_of(action, mean, log_std + h) - log_probability_of(action, mean, log_std - h)) / (2 * h),
          kDifference * (1.0 + by.z * by.z));
    }
}

TEST(LikelihoodGradient, GrowsNoMoreBeyondFourStandardDeviations) {
  EXPECT_FLOAT_EQ(likelihood_gradient(9.0F, 0.0F, 1.0F).z, 4.0F);
  EXPECT_FLOAT_EQ(likelihood_gradient(-9.0F, 0.0F, 1.0F).z, -4.0F);
  EXPECT_FLOAT_EQ(likelihood_gradient(-9.0F, 0.0F, 1.0F).log_std, 15.0F);
}

// The loss of one sample as it is printed.
double loss(double log_ratio, double advantage) {
  const double ratio = std::exp(log_ratio);
  return -std::min(ratio * advantage, std::clamp(ratio, 1.0 - kClip, 1.0 + kClip) * advantage);
}

TEST(RatioGradient, IsTheDerivativeOfTheClippedObjective) {
  for (const double advantage : {-1.5, -0.2, 0.3, 2.0})
    for (const double log_ratio : {-0.5, -0.1, 0.0, 0.1, 0.5})
      EXPECT_NEAR(ratio_gradient(static_cast<float>(log_ratio), static_cast<float>(advantage), kClip),
                  (loss(log_ratio + 1e-6, advantage) - loss(log_ratio - 1e-6, advantage)) / 2e-6, 1e-5)
          << log_ratio << " " << advantage;
}

TEST(RatioGradient, IsNotClippedOnTheEdgeAndStaysFinite) {
  EXPECT_FLOAT_EQ(ratio_gradient(0.0F, 1.0F, 0.0F), -1.0F);
  EXPECT_FLOAT_EQ(ratio_gradient(0.0F, -1.0F, 0.0F), 1.0F);
  EXPECT_TRUE(std::isfinite(ratio_gradient(1000.0F, -1.0F, kClip)));
}

TEST(GeneralisedAdvantages, AreTheDiscountedSumOfWhatWasNotForeseen) {
  const std::vector<StepWorth> steps = {{.reward = 1.0F, .value = 2.0F}, {.reward = -0.5F, .value = 1.0F}};
  const double discount = 0.9, lambda = 0.8, last = 3.0;
  const double second = -0.5 + discount * last - 1.0, first = 1.0 + discount * 1.0 - 2.0;
  const std::vector<float> worth = generalised_advantages(steps, static_cast<float>(last), discount, lambda);
  ASSERT_EQ(worth.size(), 2U);
  EXPECT_NEAR(worth[1], second, 1e-6);
  EXPECT_NEAR(worth[0], first + discount * lambda * second, 1e-6);
}

TEST(GeneralisedAdvantages, NothingComesBackOverTheEndOfAnEpisode) {
  const std::vector<StepWorth> steps = {{.reward = 1.0F, .value = 2.0F, .ends = true},
                                        {.reward = 100.0F, .value = 50.0F}};
  EXPECT_FLOAT_EQ(generalised_advantages(steps, 7.0F, 0.9, 0.8)[0], -1.0F);
}

}  // namespace
}  // namespace duet
