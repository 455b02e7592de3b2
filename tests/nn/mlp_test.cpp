#include "duet/nn/mlp.h"

#include <gtest/gtest.h>

#include <cmath>

namespace duet {
namespace {

TEST(Mlp, EqualsTheFormulaInDouble) {
  Random random(1, 2);
  Mlp mlp = random_mlp({7, 12, 5, 3}, 1.0F, random);
  for (MlpLayer& layer : mlp.layers) layer.b.setLinSpaced(-0.5F, 0.5F);
  Eigen::VectorXf input = Eigen::VectorXf::LinSpaced(7, -1.0F, 2.0F);
  Eigen::VectorXd x = input.cast<double>();
  for (size_t i = 0; i < mlp.layers.size(); ++i) {
    x = (mlp.layers[i].W.cast<double>() * x + mlp.layers[i].b.cast<double>()).eval();
    if (i + 1 < mlp.layers.size())
      for (double& value : x) value = value > 0 ? value : std::expm1(value);
  }
  MlpRunner runner(mlp);
  const std::span<const float> y = runner.run({input.data(), 7});
  ASSERT_EQ(y.size(), 3U);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(y[i], x[i], 1e-5);
}

// Weights that half precision holds run from it: the sums are the same but for their order.
TEST(Mlp, WeightsInHalfPrecisionGiveWhatTheyGiveInFloat) {
  Random random(3, 4);
  Mlp mlp = random_mlp({37, 50, 18, 5}, 1.0F, random);
  for (MlpLayer& layer : mlp.layers)
    layer.W = layer.W.unaryExpr([](float w) { return static_cast<float>(Eigen::half(w)); }).eval();
  const Eigen::VectorXf input = Eigen::VectorXf::LinSpaced(37, -1.0F, 2.0F);
  Mlp inexact = mlp;
  for (MlpLayer& layer : inexact.layers) layer.W(0, 0) += 1e-7F;  // one weight is enough
  MlpRunner half(mlp), full(inexact);
  const std::span<const float> a = half.run({input.data(), 37}), b = full.run({input.data(), 37});
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(a[i], b[i], 2e-5);
}

TEST(Mlp, SizesAreThoseAskedFor) {
  Random random(1, 2);
  EXPECT_EQ(random_mlp({4, 3, 2}, 1.0F, random).sizes(), (std::vector<int>{4, 3, 2}));
}

TEST(RandomMlp, TheLastLayerHasAScaleOfItsOwn) {
  Random random(3, 1);
  const Mlp mlp = random_mlp({50, 80, 60, 40}, 0.01F, random);
  ASSERT_EQ(mlp.layers.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::MatrixXf& W = mlp.layers[i].W;
    const float deviation = std::sqrt(W.squaredNorm() / static_cast<float>(W.size()));
    const float expected = (i == 2 ? 0.01F : 1.3F) / std::sqrt(static_cast<float>(W.cols()));
    EXPECT_NEAR(deviation, expected, 0.1F * expected) << i;
  }
}

}  // namespace
}  // namespace duet
