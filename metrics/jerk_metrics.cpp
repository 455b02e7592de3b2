// Motion smoothness: the third derivative of positions.

#include <cmath>
#include <limits>

#include "duet/core/require.h"
#include "duet/metrics/differences.h"
#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"

namespace duet {

Jerk jerk(const PointTracks& positions, double rate_hz, JerkScheme scheme, int ddof) {
  require_finite(positions, "jerk: positions");
  require_sampling(positions.frames(), rate_hz, scheme, "jerk");
  require(ddof == 0 || ddof == 1, "jerk: ddof must be 0 or 1, found {}", ddof);
  const Eigen::Map<const Eigen::MatrixXd> x(positions.data().data(), 3L * positions.points(), positions.frames());
  const Eigen::MatrixXd third = third_derivative(x, rate_hz, scheme);
  const Eigen::ArrayXd norms =
      Eigen::Map<const Eigen::Matrix3Xd>(third.data(), 3, third.size() / 3).colwise().norm().transpose().array();
  const auto n = static_cast<double>(norms.size());
  const double mean = norms.mean();
  if (n <= ddof) return {mean, std::numeric_limits<double>::quiet_NaN()};
  return {mean, std::sqrt((norms - mean).square().sum() / (n - ddof))};
}

}  // namespace duet
