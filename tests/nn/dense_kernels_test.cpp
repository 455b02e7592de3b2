#include "duet/nn/dense_kernels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "duet/core/numbers.h"

namespace duet {
namespace {

using Eigen::MatrixXf;
using Eigen::VectorXf;

// Levels that this machine has.
std::vector<const DenseKernels*> levels() {
  std::vector<const DenseKernels*> found;
  for (const char* level : {"portable", "x86-64-v2", "x86-64-v3", "x86-64-v4"}) {
    try {
      found.push_back(&dense_kernels(level));
    } catch (const std::invalid_argument&) {
      continue;
    }
  }
  return found;
}

MatrixXf random_matrix(int rows, int cols, std::uint64_t stream) {
  Random random(3, stream);
  MatrixXf matrix(rows, cols);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix.data()[i] = static_cast<float>(random.normal());
  return matrix;
}

// A sum of k products of numbers near 1 is off by no more than a few epsilon times k.
float tolerance(int k) { return 16.0F * static_cast<float>(k) * std::numeric_limits<float>::epsilon(); }

TEST(DenseKernels, GemmEqualsDoubleForEveryTransposition) {
  constexpr int m = 29, n = 17, k = 163;
  for (const DenseKernels* kernels : levels())
    for (const bool ta : {false, true})
      for (const bool tb : {false, true}) {
        const MatrixXf A = random_matrix(ta ? k : m, ta ? m : k, 1), B = random_matrix(tb ? n : k, tb ? k : n, 2);
        const Eigen::MatrixXd a = (ta ? MatrixXf(A.transpose()) : A).cast<double>();
        const Eigen::MatrixXd b = (tb ? MatrixXf(B.transpose()) : B).cast<double>();
        MatrixXf C = random_matrix(m, n, 3);
        const Eigen::MatrixXd sum = C.cast<double>() + a * b;
        kernels->gemm(ta, tb, m, n, k, A.data(), B.data(), C.data(), true);
        EXPECT_LT((C.cast<double>() - sum).cwiseAbs().maxCoeff(), tolerance(k))
            << to_string(kernels->level) << ta << tb;
        kernels->gemm(ta, tb, m, n, k, A.data(), B.data(), C.data(), false);
        EXPECT_LT((C.cast<double>() - a * b).cwiseAbs().maxCoeff(), tolerance(k))
            << to_string(kernels->level) << ta << tb;
      }
}

TEST(DenseKernels, GemvEqualsDoubleWithAndWithoutBias) {
  constexpr int rows = 13, cols = 456;
  const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W = random_matrix(rows, cols, 4);
  const VectorXf x = random_matrix(cols, 1, 5), b = random_matrix(rows, 1, 6);
  const Eigen::VectorXd product = W.cast<double>() * x.cast<double>();
  for (const DenseKernels* kernels : levels()) {
    VectorXf y(rows);
    kernels->gemv(rows, cols, W.data(), x.data(), nullptr, y.data());
    EXPECT_LT((y.cast<double>() - product).cwiseAbs().maxCoeff(), tolerance(cols));
    kernels->gemv(rows, cols, W.data(), x.data(), b.data(), y.data());
    EXPECT_LT((y.cast<double>() - product - b.cast<double>()).cwiseAbs().maxCoeff(), tolerance(cols));
  }
}

TEST(DenseKernels, GemvOfHalvesEqualsDoubleForAnyNumberOfRows) {
  constexpr int cols = 3 * kHalfColumns;
  for (const int rows : {1, 3, 4, 13}) {
    const VectorXf x = random_matrix(cols, 1, 5), b = random_matrix(rows, 1, 6);
    const Eigen::Matrix<Eigen::half, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W =
        random_matrix(rows, cols, 4).cast<Eigen::half>();
    const Eigen::VectorXd product = W.cast<double>() * x.cast<double>();
    std::vector<std::uint16_t> halves(half_size(rows, cols), 0);
    for (int row = 0; row < rows; ++row)
      for (int c = 0; c < cols; ++c) halves[half_index(row, c, cols)] = W(row, c).x;
    for (const DenseKernels* kernels : levels()) {
      VectorXf y(rows);
      kernels->gemv_half(rows, cols, halves.data(), x.data(), nullptr, y.data());
      EXPECT_LT((y.cast<double>() - product).cwiseAbs().maxCoeff(), tolerance(cols)) << to_string(kernels->level);
      kernels->gemv_half(rows, cols, halves.data(), x.data(), b.data(), y.data());
      EXPECT_LT((y.cast<double>() - product - b.cast<double>()).cwiseAbs().maxCoeff(), tolerance(cols));
    }
  }
}

TEST(DenseKernels, EluAndItsDerivativeAreTheClosedForms) {
  for (const DenseKernels* kernels : levels())
    for (const float x : {-30.0F, -1.0F, -1e-3F, 0.0F, 1e-3F, 2.0F}) {
      float a = x, d = 3.0F;
      kernels->elu(1, &a);
      EXPECT_NEAR(a, x > 0 ? x : std::expm1(x), 2e-7) << x;
      kernels->elu_backward(1, &a, &d);
      EXPECT_NEAR(d, x > 0 ? 3.0 : 3.0 * std::exp(x), 1e-6) << x;
    }
}

TEST(DenseKernels, BitsDoNotDependOnWhereTheArrayLies) {
  const VectorXf x = random_matrix(300, 1, 7);
  for (const DenseKernels* kernels : levels()) {
    VectorXf expected = x;
    kernels->elu(300, expected.data());
    for (int offset = 0; offset < 16; ++offset) {
      std::vector<float> room(316);
      std::copy(x.begin(), x.end(), room.begin() + offset);
      kernels->elu(300, room.data() + offset);
      for (int i = 0; i < 300; ++i)
        ASSERT_EQ(room[offset + i], expected[i]) << to_string(kernels->level) << " " << offset;
    }
  }
}

TEST(DenseKernels, AdamsFirstStepHasTheLengthOfTheRate) {
  for (const DenseKernels* kernels : levels()) {
    float g = -0.4F, m = 0.0F, v = 0.0F, p = 1.0F;
    kernels->adam(1, &g, 1.0F, 0.01F / 0.1F, 0.001F, &m, &v, &p);
    EXPECT_NEAR(p, 1.01F, 1e-5);
  }
}

TEST(DenseKernels, NanComesOutAsNan) {
  for (const DenseKernels* kernels : levels()) {
    const float W[2] = {1.0F, 1.0F}, x[2] = {std::nanf(""), 1.0F};
    float y = 0.0F;
    kernels->gemv(1, 2, W, x, nullptr, &y);
    EXPECT_TRUE(std::isnan(y)) << to_string(kernels->level);
    float a[4] = {std::nanf(""), -INFINITY, INFINITY, -1.0F};
    kernels->elu(4, a);
    EXPECT_TRUE(std::isnan(a[0])) << to_string(kernels->level);
    EXPECT_EQ(a[1], -1.0F) << to_string(kernels->level);
    EXPECT_EQ(a[2], INFINITY) << to_string(kernels->level);
  }
}

TEST(DenseKernels, AnUnknownLevelIsRefusedByName) {
  EXPECT_THAT([] { dense_kernels("x86-64-v9"); },
              testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("'x86-64-v9'")));
}

}  // namespace
}  // namespace duet
