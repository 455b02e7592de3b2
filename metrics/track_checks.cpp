#include "duet/metrics/track_checks.h"

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

}  // namespace duet
