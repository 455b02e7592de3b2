#include "duet/nn/dense_kernels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <bit>
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

// The order of the sums, written out: sixteen lanes, folded; then the columns that are left over.
float product_in_order(int cols, const float* w, const float* x, bool rounds_eight) {
  std::array<float, 16> lanes = {};
  int c = 0;
  for (; c + 16 <= cols; c += 16)
    for (int i = 0; i < 16; ++i) lanes[i] = std::fma(w[c + i], x[c + i], lanes[i]);
  for (int half = 8; half > 0; half /= 2)
    for (int i = 0; i < half; ++i) lanes[i] += lanes[i + half];
  for (const int first = c; c < cols; ++c)
    if (rounds_eight && cols - first >= 8 && c < first + 8) {
      volatile const float product = w[c] * x[c];
      lanes[0] += product;
    } else {
      lanes[0] = std::fma(w[c], x[c], lanes[0]);
    }
  return lanes[0];
}

// As gemv_half wants them; `filled`: the columns, filled up.
std::vector<std::uint16_t> in_halves(const MatrixXf& W, int filled) {
  std::vector<std::uint16_t> halves(half_size(static_cast<int>(W.rows()), filled), 0);
  for (int row = 0; row < W.rows(); ++row)
    for (int c = 0; c < W.cols(); ++c) halves[half_index(row, c, filled)] = Eigen::half(W(row, c)).x;
  return halves;
}

std::vector<const DenseKernels*> levels_that_fuse() {
  std::vector<const DenseKernels*> found = levels();
  std::erase_if(found, [](const DenseKernels* kernels) {
    return kernels->level != InstructionSet::kV3 && kernels->level != InstructionSet::kV4;
  });
  return found;
}

TEST(DenseKernels, SumsHaveOneOrderOnEveryProcessorThatFuses) {
  constexpr int rows = 29;
  for (const DenseKernels* kernels : levels_that_fuse())
    for (const int cols : {1, 7, 8, 15, 16, 48, 93, 94, 456}) {
      const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W = random_matrix(rows, cols, 4);
      const VectorXf x = random_matrix(cols, 1, 5), b = random_matrix(rows, 1, 6);
      VectorXf y(rows), halves_y(rows);
      kernels->gemv(rows, cols, W.data(), x.data(), b.data(), y.data());
      const int filled = (cols + kHalfColumns - 1) / kHalfColumns * kHalfColumns;
      VectorXf padded = VectorXf::Zero(filled);
      padded.head(cols) = x;
      const std::vector<std::uint16_t> halves = in_halves(W, filled);
      kernels->gemv_half(rows, filled, halves.data(), padded.data(), b.data(), halves_y.data());
      for (int row = 0; row < rows; ++row) {
        EXPECT_EQ(y[row], b[row] + product_in_order(cols, W.row(row).data(), x.data(), true)) << cols << " " << row;
        VectorXf rounded = VectorXf::Zero(filled);
        for (int c = 0; c < cols; ++c) rounded[c] = static_cast<float>(Eigen::half(W(row, c)));
        EXPECT_EQ(halves_y[row], b[row] + product_in_order(filled, rounded.data(), padded.data(), false)) << cols;
      }
    }
}

TEST(DenseKernels, AMatrixProductAddsItsTermsInOrderOnEveryProcessorThatFuses) {
  constexpr int m = 67, n = 31, k = 45;
  const MatrixXf A = random_matrix(m, k, 1), B = random_matrix(k, n, 2), start = random_matrix(m, n, 3);
  const MatrixXf turned_a = A.transpose(), turned_b = B.transpose();
  for (const DenseKernels* kernels : levels_that_fuse())
    for (const bool ta : {false, true})
      for (const bool tb : {false, true}) {
        MatrixXf C = start;
        kernels->gemm(ta, tb, m, n, k, (ta ? turned_a : A).data(), (tb ? turned_b : B).data(), C.data(), true);
        for (int j = 0; j < n; ++j)
          for (int i = 0; i < m; ++i) {
            float sum = 0.0F;
            for (int l = 0; l < k; ++l) sum = std::fma(A(i, l), B(l, j), sum);
            ASSERT_EQ(C(i, j), start(i, j) + sum) << i << " " << j;
          }
      }
}

TEST(DenseKernels, EluAndAdamHaveOneResultOnEveryProcessorThatFuses) {
  constexpr int n = 1000;
  const VectorXf x = 20.0F * random_matrix(n, 1, 7), g = random_matrix(n, 1, 8);
  for (const DenseKernels* kernels : levels_that_fuse()) {
    VectorXf y = x, d = g, m = g, v = x.cwiseAbs(), p = x;
    kernels->elu(n, y.data());
    kernels->elu_backward(n, y.data(), d.data());
    kernels->adam(n, g.data(), 0.3F, 0.01F, 0.1F, m.data(), v.data(), p.data());
    std::uint64_t checksum = 14695981039346656037U;
    for (const VectorXf* values : {&y, &d, &m, &v, &p})
      for (const float value : *values) checksum = (checksum ^ std::bit_cast<std::uint32_t>(value)) * 1099511628211U;
    EXPECT_EQ(checksum, 295425318120728464U) << to_string(kernels->level);
  }
}

TEST(DenseKernels, GemvOfHalvesEqualsDoubleForAnyNumberOfRows) {
  constexpr int cols = 3 * kHalfColumns;
  for (const int rows : {1, 3, 4, 13}) {
    const VectorXf x = random_matrix(cols, 1, 5), b = random_matrix(rows, 1, 6);
    const MatrixXf W = random_matrix(rows, cols, 4).cast<Eigen::half>().cast<float>();
    const Eigen::VectorXd product = W.cast<double>() * x.cast<double>();
    const std::vector<std::uint16_t> halves = in_halves(W, cols);
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
