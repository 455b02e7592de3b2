#include "duet/retarget/gaussian_filter.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace duet {

Eigen::MatrixXd gaussian_filter(const Eigen::MatrixXd& x) {
  constexpr int kRadius = 2;
  constexpr double kSigma = 0.75;
  std::array<double, 2 * kRadius + 1> weight{};
  double sum = 0.0;
  for (int k = -kRadius; k <= kRadius; ++k) sum += weight[k + kRadius] = std::exp(-0.5 * k * k / (kSigma * kSigma));
  for (double& w : weight) w /= sum;

  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index t = 0; t < x.cols(); ++t) {
    for (int k = -kRadius; k <= kRadius; ++k) {
      out.col(t) += weight[k + kRadius] * x.col(std::clamp<Eigen::Index>(t + k, 0, x.cols() - 1));
    }
  }
  return out;
}

}  // namespace duet
