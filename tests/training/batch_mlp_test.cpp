#include <gtest/gtest.h>

#include <cmath>

#include "duet/training/agent.h"

namespace duet {
namespace {

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
