#include <gtest/gtest.h>

#include <cmath>

#include "duet/retarget/solver/pair.h"

namespace duet {
namespace {

TEST(GaussianFilter, ImpulseGivesTheNormalisedKernel) {
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(1, 9);
  x(0, 4) = 1.0;
  const Eigen::MatrixXd y = gaussian_filter(x);
  EXPECT_NEAR(y.sum(), 1.0, 1e-15);
  EXPECT_NEAR(y(0, 5) / y(0, 4), std::exp(-0.5 / (0.75 * 0.75)), 1e-15);
  EXPECT_NEAR(y(0, 6) / y(0, 4), std::exp(-0.5 * 4 / (0.75 * 0.75)), 1e-15);
  EXPECT_EQ(y(0, 5), y(0, 3));
  EXPECT_EQ(y(0, 1), 0.0);
  EXPECT_EQ(y(0, 7), 0.0);
}

TEST(GaussianFilter, KeepsConstantsToTheEndsAndLinesInside) {
  const Eigen::MatrixXd constant = Eigen::MatrixXd::Constant(3, 5, 0.7);
  EXPECT_LT((gaussian_filter(constant) - constant).cwiseAbs().maxCoeff(), 1e-15);
  const Eigen::RowVectorXd line = Eigen::RowVectorXd::LinSpaced(12, -1.0, 2.0);
  const Eigen::MatrixXd y = gaussian_filter(line);
  EXPECT_LT((y.middleCols(2, 8) - line.middleCols(2, 8)).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_GT(y(0, 0), line[0]);  // the first value repeats before the start
}

TEST(GaussianFilter, OneFrameStays) {
  EXPECT_NEAR(gaussian_filter(Eigen::MatrixXd::Constant(1, 1, 2.0))(0, 0), 2.0, 1e-15);
}

}  // namespace
}  // namespace duet
