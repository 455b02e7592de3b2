#include "duet/training/ppo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/training/agent.h"
#include "duet/training/distill.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using test::g1;

class DistillationInMujoco : public test::InMujoco {};
class PpoInMujoco : public test::InMujoco {};
class TrainingStateInMujoco : public test::InMujoco {};

PpoOptions small() {
  PpoOptions options;
  options.environments = 4;
  options.horizon = 16;
  options.epochs = 2;
  options.minibatches = 2;
  return options;
}

TrainingState fresh(std::uint64_t seed = 1) {
  TrainingState state;
  state.agent = make_agent(163, 361, 29, 0.5, seed);
  state.seed = seed;
  state.stage = "stand";
  state.robot_digest = g1()->digest;
  return state;
}

TEST_F(PpoInMujoco, TheSeedDecidesEveryWeight) {
  Ppo a(g1(), wbc_stage("stand"), small(), fresh()), b(g1(), wbc_stage("stand"), small(), fresh());
  Ppo c(g1(), wbc_stage("stand"), small(), fresh(2));
  for (int i = 0; i < 2; ++i) {
    a.iterate();
    b.iterate();
    c.iterate();
  }
  EXPECT_EQ(a.state().agent.actor.layers[1].W, b.state().agent.actor.layers[1].W);
  EXPECT_EQ(a.state().agent.log_std, b.state().agent.log_std);
  EXPECT_NE(a.state().agent.actor.layers[1].W, c.state().agent.actor.layers[1].W);
}

TEST_F(PpoInMujoco, AnIterationCountsItsStepsAndMovesTheWeights) {
  Ppo ppo(g1(), wbc_stage("stand"), small(), fresh());
  const Mlp before = ppo.state().agent.actor;
  const IterationReport report = ppo.iterate();
  EXPECT_EQ(report.steps, 64);
  EXPECT_EQ(report.iteration, 1);
  EXPECT_GT(report.divergence, 0.0);
  EXPECT_NE(before.layers[0].W, ppo.state().agent.actor.layers[0].W);
}

TEST_F(PpoInMujoco, NoActionIsDrawnFartherThanTheLargestDeviation) {
  PpoOptions options = small();
  options.largest_std = 0.3;
  Ppo ppo(g1(), wbc_stage("stand"), options, fresh());  // begins with 0.5
  ppo.iterate();
  EXPECT_LE(ppo.state().agent.log_std.maxCoeff(), std::log(0.3F) + 1e-6F);
}

// No episode that ended can have lasted longer than what was simulated.
TEST_F(PpoInMujoco, EpisodesAreAsLongAsTheirTicks) {
  PpoOptions options = small();
  options.horizon = 150;
  options.epochs = 1;
  Ppo ppo(g1(), wbc_stage("stand"), options, fresh());
  const IterationReport report = ppo.iterate();
  ASSERT_GT(report.episodes, 0);
  EXPECT_GT(report.episode_seconds, 0.02);
  EXPECT_LE(report.episode_seconds, 150 * 0.02);
}

TEST(Ppo, OptionsThatDoNotDivideAreRefused) {
  PpoOptions options = small();
  options.environments = 5;
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { Ppo(g1(), wbc_stage("stand"), options, fresh()); }));
  options.threads = 1;
  options.minibatches = 1;
  EXPECT_NO_THROW(Ppo(g1(), wbc_stage("stand"), options, fresh()));
  options.threads = 0;
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { Ppo(g1(), wbc_stage("stand"), options, fresh()); }));
}

TEST_F(TrainingStateInMujoco, IsTheSameAfterTheFile) {
  Ppo ppo(g1(), wbc_stage("stand"), small(), fresh());
  ppo.iterate();
  const TrainingState& state = ppo.state();
  const TrainingState read = training_state(to_tensors(state), "x");
  EXPECT_EQ(read.agent.actor.layers[2].W, state.agent.actor.layers[2].W);
  EXPECT_EQ(read.agent.critic_input.variance, state.agent.critic_input.variance);
  EXPECT_EQ(read.adam.m.back(), state.adam.m.back());
  EXPECT_EQ(read.adam.steps, state.adam.steps);
  EXPECT_EQ(read.steps, state.steps);
  EXPECT_EQ(read.robot_digest, state.robot_digest);
}

TEST(TrainingState, WhatIsMissingIsNamed) {
  SafeTensors tensors = to_tensors(fresh());
  tensors.tensors.erase("critic_input.mean");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { training_state(tensors, "a.safetensors"); }));
  tensors = to_tensors(fresh());
  tensors.metadata["format"] = "other";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { training_state(tensors, "a"); }));
}

TEST_F(DistillationInMujoco, TheLossFallsAndTheSeedDecides) {
  DistillOptions options;
  options.environments = 4;
  options.buffer = 256;
  options.batch = 64;
  options.warm_rounds = 100;  // the oracle acts: the same states for both students
  WbcTask task = wbc_stage("stand");
  Distillation a(g1(), task, options, fresh().agent, make_student(29, 1), 40);
  Distillation b(g1(), task, options, fresh().agent, make_student(29, 1), 40);
  double first = 0.0, last = 0.0;
  for (int i = 0; i < 20; ++i) {
    const double loss = a.iterate().loss;
    EXPECT_EQ(loss, b.iterate().loss);
    if (i == 0) first = loss;
    last = loss;
  }
  EXPECT_LT(last, 0.7 * first);
}

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

Eigen::MatrixXf random_matrix(int rows, int cols, std::uint64_t stream) {
  Random random(9, stream);
  Eigen::MatrixXf matrix(rows, cols);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = static_cast<float>(random.normal());
  return matrix;
}

TEST(BatchMlp, ForwardIsThatOfTheRunnerForEachColumn) {
  Random random(1, 1);
  const Mlp mlp = random_mlp({6, 10, 4, 3}, 1.0F, random);
  const Eigen::MatrixXf x = random_matrix(6, 17, 2);
  BatchMlp batch(mlp);
  MlpRunner runner(mlp);
  const Eigen::MatrixXf y = batch.forward(x);
  for (int c = 0; c < x.cols(); ++c) {
    const std::span<const float> expected = runner.run({x.col(c).data(), 6});
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(y(k, c), expected[k], 1e-5);
  }
}

// The loss is a weighted sum of outputs; its derivative by each weight is compared with a central difference.
TEST(BatchMlp, GradientIsTheFiniteDifference) {
  Random random(1, 1);
  Mlp mlp = random_mlp({5, 8, 6, 2}, 1.0F, random);
  const Eigen::MatrixXf x = random_matrix(5, 11, 3), weight = random_matrix(2, 11, 4);
  BatchMlp batch(mlp);
  batch.forward(x);
  batch.backward(weight);
  MlpGradient gradient = batch.gradient();
  const auto loss = [&] {
    BatchMlp fresh(mlp);
    return fresh.forward(x).cwiseProduct(weight).cast<double>().sum();
  };
  auto parameters = flat_views(mlp.layers);
  auto gradients = flat_views(gradient);
  constexpr float h = 1e-2F;  // float forward passes: differences of 1e-6 / h, curvature of h^2
  for (size_t block = 0; block < parameters.size(); ++block)
    for (Eigen::Index i = 0; i < parameters[block].size(); i += 7) {
      const float kept = parameters[block][i];
      parameters[block][i] = kept + h;
      const double above = loss();
      parameters[block][i] = kept - h;
      const double below = loss();
      parameters[block][i] = kept;
      EXPECT_NEAR(gradients[block][i], (above - below) / (2.0 * h), 3e-2) << block << " " << i;
    }
}

TEST(Adam, FindsTheLeastOfAParabola) {
  Eigen::VectorXf p = Eigen::VectorXf::Constant(3, 4.0F), g(3);
  std::vector<Eigen::Map<Eigen::VectorXf>> parameters, gradients;
  parameters.emplace_back(p.data(), 3);
  gradients.emplace_back(g.data(), 3);
  Adam adam;
  for (int i = 0; i < 2000; ++i) {
    g = 2.0F * (p - Eigen::Vector3f(1.0F, -2.0F, 0.5F));
    adam.step(parameters, gradients, 0.02, 1e9);
  }
  EXPECT_LT((p - Eigen::Vector3f(1.0F, -2.0F, 0.5F)).norm(), 1e-2F);
}

TEST(Normaliser, BatchesGiveTheMomentsOfAllSamples) {
  const Eigen::MatrixXf all = 3.0F * random_matrix(4, 600, 5).array() + 2.0F;
  Normaliser normaliser(4);
  normaliser.count = 0.0;
  for (int b = 0; b < 6; ++b) normaliser.update(all.middleCols(100 * b, 100));
  const Eigen::VectorXf mean = all.rowwise().mean();
  EXPECT_LT((normaliser.mean - mean).norm(), 1e-4F);
  EXPECT_LT((normaliser.variance - (all.colwise() - mean).array().square().rowwise().mean().matrix()).norm(), 1e-3F);
}

TEST(Normaliser, ClipsWhatIsFarOff) {
  Normaliser normaliser(1);
  Eigen::MatrixXf x(1, 2);
  x << 1e6F, -1e6F;
  normaliser.apply(x);
  EXPECT_EQ(x(0, 0), 5.0F);
  EXPECT_EQ(x(0, 1), -5.0F);
}

TEST(Normaliser, TakesTheMeanOffAndDividesByTheDeviation) {
  Normaliser normaliser(2);
  normaliser.mean << 3.0F, -2.0F;
  normaliser.set_deviation(Eigen::Vector2f(0.5F, 4.0F));
  Eigen::MatrixXf x(2, 2);
  x << 4.0F, 3.0F, 2.0F, -6.0F;
  normaliser.apply(x);
  EXPECT_LT((x - (Eigen::MatrixXf(2, 2) << 2.0F, 0.0F, 1.0F, -1.0F).finished()).norm(), 1e-5F);
}

}  // namespace
}  // namespace duet
