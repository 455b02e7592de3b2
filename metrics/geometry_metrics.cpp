// JPE and AWD: how far the robot's geometry is from the source's.
#include <cmath>

#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"

namespace duet {
namespace {

double pair_distance(const PointTracks& a, int i, const PointTracks& b, int j, int t) {
  return (a.at(t, i) - b.at(t, j)).norm();
}

// Sums over frames of the entries' absolute differences, each unordered pair once.
struct BlockSums {
  double within = 0.0;  // both points of the same agent
  double cross = 0.0;   // one of each
};

BlockSums block_sums(const PointTracks& source_a, const PointTracks& source_b, const PointTracks& new_a,
                     const PointTracks& new_b) {
  BlockSums sums;
  const int points = source_a.points();
  for (int t = 0; t < source_a.frames(); ++t) {
    for (int i = 0; i < points; ++i) {
      for (int j = i + 1; j < points; ++j) {
        sums.within += std::abs(pair_distance(source_a, i, source_a, j, t) - pair_distance(new_a, i, new_a, j, t));
        sums.within += std::abs(pair_distance(source_b, i, source_b, j, t) - pair_distance(new_b, i, new_b, j, t));
      }
      for (int j = 0; j < points; ++j)
        sums.cross += std::abs(pair_distance(source_a, i, source_b, j, t) - pair_distance(new_a, i, new_b, j, t));
    }
  }
  return sums;
}

}  // namespace

double jpe(const PointTracks& robot, const PointTracks& reshaped, JpeFrame frame) {
  require_finite(robot, "jpe: robot");
  require_finite(reshaped, "jpe: reshaped");
  require_same_shape(reshaped, robot, "jpe: reshaped", "robot");
  double sum = 0.0;
  for (int t = 0; t < robot.frames(); ++t) {
    Eigen::Matrix3Xd difference = robot.frame(t) - reshaped.frame(t);
    if (frame == JpeFrame::kPelvis) difference.colwise() -= Eigen::Vector3d(difference.col(0));
    sum += difference.colwise().norm().sum();
  }
  return sum / (static_cast<double>(robot.frames()) * robot.points());
}

// The divisor of each reading is the number of its entries: N^2 with the diagonal for `full`, without it N (N - 1) for
// `offdiag`, 2 K^2 for `cross`, 2 K (K - 1) for `within`.
double awd(const PointTracks& source_initiator, const PointTracks& source_responder, const PointTracks& new_initiator,
           const PointTracks& robot, AwdEntries entries) {
  require_finite(source_initiator, "awd: source_initiator");
  require_finite(source_responder, "awd: source_responder");
  require_finite(new_initiator, "awd: new_initiator");
  require_finite(robot, "awd: robot");
  require_same_shape(source_responder, source_initiator, "awd: source_responder", "source_initiator");
  require_same_shape(new_initiator, source_initiator, "awd: new_initiator", "source_initiator");
  require_same_shape(robot, source_initiator, "awd: robot", "source_initiator");

  const double k = source_initiator.points();
  const double n = 2.0 * k;
  const double frames = source_initiator.frames();
  const BlockSums sums = block_sums(source_initiator, source_responder, new_initiator, robot);
  switch (entries) {
    case AwdEntries::kOffdiag:
      return 2.0 * (sums.within + sums.cross) / (frames * n * (n - 1.0));
    case AwdEntries::kCross:
      return sums.cross / (frames * k * k);
    case AwdEntries::kWithin:
      return k > 1.0 ? sums.within / (frames * k * (k - 1.0)) : 0.0;
    case AwdEntries::kFull:
      break;
  }
  return 2.0 * (sums.within + sums.cross) / (frames * n * n);
}

}  // namespace duet
