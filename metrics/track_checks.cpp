#include "duet/metrics/track_checks.h"

#include <cmath>

#include "duet/core/require.h"

namespace duet {

void require_finite(const PointTracks& tracks, const std::string& what) {
  require(!tracks.empty(), what + " is empty");
  for (int t = 0; t < tracks.frames(); ++t) {
    if (tracks.frame(t).allFinite()) continue;
    for (int k = 0; k < tracks.points(); ++k)
      require(tracks.at(t, k).allFinite(), "{} is not finite at frame {}, point {}", what, t, k);
  }
}

void require_same_shape(const PointTracks& tracks, const PointTracks& other, const std::string& what,
                        const std::string& other_name) {
  require(tracks.frames() == other.frames() && tracks.points() == other.points(),
          "{} has {} frames of {} points, but {} has {} of {}", what, tracks.frames(), tracks.points(), other_name,
          other.frames(), other.points());
}

void require_finite(const Eigen::MatrixXd& values, const std::string& what) {
  require(values.size() > 0, what + " is empty");
  if (values.allFinite()) return;
  for (Eigen::Index t = 0; t < values.cols(); ++t)
    for (Eigen::Index j = 0; j < values.rows(); ++j)
      require(std::isfinite(values(j, t)), "{} is not finite at frame {}, joint {}", what, t, j);
}

void require_same_shape(const Eigen::MatrixXd& values, const Eigen::MatrixXd& other, const std::string& what,
                        const std::string& other_name) {
  require(values.rows() == other.rows() && values.cols() == other.cols(),
          "{} has {} joints and {} frames, but {} has {} and {}", what, values.rows(), values.cols(), other_name,
          other.rows(), other.cols());
}

Eigen::MatrixXd gradient(const Eigen::Ref<const Eigen::MatrixXd>& x, double rate_hz) {
  const Eigen::Index n = x.cols();
  Eigen::MatrixXd result(x.rows(), n);
  result.col(0) = (x.col(1) - x.col(0)) * rate_hz;
  result.col(n - 1) = (x.col(n - 1) - x.col(n - 2)) * rate_hz;
  result.middleCols(1, n - 2) = (x.rightCols(n - 2) - x.leftCols(n - 2)) * (0.5 * rate_hz);
  return result;
}

Eigen::MatrixXd third_derivative(const Eigen::Ref<const Eigen::MatrixXd>& x, double rate_hz, JerkScheme scheme) {
  const double cubed = rate_hz * rate_hz * rate_hz;
  if (scheme == JerkScheme::kGradient) return gradient(gradient(gradient(x, rate_hz), rate_hz), rate_hz);
  if (scheme == JerkScheme::kCentral) {
    const Eigen::Index n = x.cols() - 4;
    return (x.middleCols(4, n) - 2.0 * x.middleCols(3, n) + 2.0 * x.middleCols(1, n) - x.leftCols(n)) * (0.5 * cubed);
  }
  const Eigen::Index n = x.cols() - 3;
  return (x.middleCols(3, n) - 3.0 * x.middleCols(2, n) + 3.0 * x.middleCols(1, n) - x.leftCols(n)) * cubed;
}

int min_samples(JerkScheme scheme) { return scheme == JerkScheme::kCentral ? 5 : 4; }

void require_sampling(Eigen::Index samples, double rate_hz, JerkScheme scheme, const char* what) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "{}: the rate must be positive, found {}", what, rate_hz);
  require(samples >= min_samples(scheme), "{} needs {} frames or more, found {}", what, min_samples(scheme), samples);
}

}  // namespace duet
