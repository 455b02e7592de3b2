// The 18 retargeting metrics, term by term.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "duet/core/require.h"
#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"
#include "duet/tasks/rules/evidence.h"

namespace duet {

// Physical plausibility: magnitudes of joint rotations, how often they are large and how they spread.

namespace {

// Which of the card's compound joints each hinge belongs to, -1 for one that stands alone.
std::vector<int> compound_of_hinges(const RobotModel& robot) {
  std::vector<int> compound(robot.joints.size(), -1);
  for (size_t group = 0; group < robot.roles.compound.size(); ++group)
    for (const int joint : robot.roles.compound[group]) compound[joint] = static_cast<int>(group);
  return compound;
}

void check_group(const HingeGroup& group, size_t index, Eigen::Index joints) {
  const std::string what = fmt::format("grouped_magnitudes: group {}", index);
  require(!group.rows.empty(), what + " has no hinge");
  require(group.rows.size() == group.axes.size(), "{} has {} rows but {} axes", what, group.rows.size(),
          group.axes.size());
  for (const int row : group.rows)
    require(row >= 0 && row < joints, "{} names row {}, but q has {} joints", what, row, joints);
  for (const Eigen::Vector3d& axis : group.axes)
    require(axis.allFinite() && axis.norm() > 0.0, what + " has an axis without direction");
}

// Angle of a unit quaternion's rotation, in [0, pi]; exact near both ends.
double angle_of(const Eigen::Quaterniond& rotation) {
  return 2.0 * std::atan2(rotation.vec().norm(), std::abs(rotation.w()));
}

double standard_deviation(const Eigen::Ref<const Eigen::ArrayXXd>& values, int ddof) {
  const auto n = static_cast<double>(values.size());
  if (n <= ddof) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt((values - values.mean()).square().sum() / (n - ddof));
}

}  // namespace

Eigen::MatrixXd hinge_magnitudes(const Eigen::MatrixXd& q) {
  require_finite(q, "hinge_magnitudes: q");
  return q.cwiseAbs();
}

Eigen::MatrixXd grouped_magnitudes(const Eigen::MatrixXd& q, const std::vector<HingeGroup>& groups) {
  require_finite(q, "grouped_magnitudes: q");
  require(!groups.empty(), "grouped_magnitudes: no groups");
  Eigen::MatrixXd magnitudes(groups.size(), q.cols());
  for (size_t g = 0; g < groups.size(); ++g) {
    check_group(groups[g], g, q.rows());
    for (Eigen::Index t = 0; t < q.cols(); ++t) {
      Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
      for (size_t i = 0; i < groups[g].rows.size(); ++i)
        rotation *= Eigen::Quaterniond(Eigen::AngleAxisd(q(groups[g].rows[i], t), groups[g].axes[i].normalized()));
      magnitudes(static_cast<Eigen::Index>(g), t) = angle_of(rotation);
    }
  }
  return magnitudes;
}

Eigen::MatrixXd rotvec_magnitudes(const PointTracks& rotvecs) {
  require_finite(rotvecs, "rotvec_magnitudes: rotvecs");
  Eigen::MatrixXd magnitudes(rotvecs.points(), rotvecs.frames());
  for (int t = 0; t < rotvecs.frames(); ++t) magnitudes.col(t) = rotvecs.frame(t).colwise().norm().transpose();
  return magnitudes;
}

double large_angle_ratio(const Eigen::MatrixXd& magnitudes, LargeAngle reading, double limit) {
  require_finite(magnitudes, "large_angle_ratio: magnitudes");
  require(std::isfinite(limit), "large_angle_ratio: limit is not finite");
  const auto large = magnitudes.array() > limit;
  const auto frames = static_cast<double>(magnitudes.cols());
  switch (reading) {
    case LargeAngle::kEntry:
      return static_cast<double>(large.count()) / static_cast<double>(magnitudes.size());
    case LargeAngle::kFrameMean:
      return static_cast<double>((magnitudes.colwise().mean().array() > limit).count()) / frames;
    case LargeAngle::kFrameAll:
      return static_cast<double>(large.colwise().all().count()) / frames;
    case LargeAngle::kFrameAny:
      break;
  }
  return static_cast<double>(large.colwise().any().count()) / frames;
}

double angle_std(const Eigen::MatrixXd& magnitudes, AngleStd reading, int ddof) {
  require_finite(magnitudes, "angle_std: magnitudes");
  require(ddof == 0 || ddof == 1, "angle_std: ddof must be 0 or 1, found {}", ddof);
  if (reading == AngleStd::kPooled) return standard_deviation(magnitudes.array(), ddof);
  double sum = 0.0;
  for (Eigen::Index j = 0; j < magnitudes.rows(); ++j) sum += standard_deviation(magnitudes.row(j).array(), ddof);
  return sum / static_cast<double>(magnitudes.rows());
}

// Axes are turned into the frame of the link before the group's first hinge at q = 0, so that their rotations in order
// multiply to the rotation from the pose at zero.
std::vector<HingeGroup> hinge_groups(const RobotModel& robot) {
  std::vector<HingeGroup> groups;
  std::vector<Eigen::Quaterniond> to_group(robot.links.size());  // rotation of a link at q = 0 in its group's frame
  std::vector<size_t> group_of(robot.links.size());
  const std::vector<int> compound = compound_of_hinges(robot);
  for (size_t i = 1; i < robot.links.size(); ++i) {
    const RobotLink& link = robot.links[i];
    const bool continues = link.parent > 0 && compound[i - 1] >= 0 && compound[i - 1] == compound[link.parent - 1];
    if (!continues) groups.emplace_back();
    group_of[i] = continues ? group_of[static_cast<size_t>(link.parent)] : groups.size() - 1;
    to_group[i] = continues ? to_group[static_cast<size_t>(link.parent)] * link.X_PL.R : link.X_PL.R;
    HingeGroup& group = groups[group_of[i]];
    group.rows.push_back(static_cast<int>(i) - 1);
    group.axes.emplace_back(to_group[i] * link.axis);
  }
  return groups;
}

// Multi-threshold contact classification: which hands touch, in the source and after retargeting. An entry is a frame
// and a hand of the initiator; its partner hand comes from the matching.

namespace {

// Distances of the initiator's hand (row) and the other's (column), left then right. [m]
using HandDistances = Eigen::Matrix2d;

std::vector<HandDistances> hand_distances(const PointTracks& initiator, const PointTracks& other) {
  std::vector<HandDistances> distances(initiator.frames());
  for (int t = 0; t < initiator.frames(); ++t)
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) distances[t](i, j) = (initiator.at(t, i) - other.at(t, j)).norm();
  return distances;
}

// Whether left goes with right. A tie pairs left with left.
bool crossed_by_sum(const HandDistances& d) { return d(0, 1) + d(1, 0) < d(0, 0) + d(1, 1); }
bool crossed_by_max(const HandDistances& d) { return std::max(d(0, 1), d(1, 0)) < std::max(d(0, 0), d(1, 1)); }

FrameMask crossed_frames(const std::vector<HandDistances>& distances, HandMatching matching) {
  FrameMask crossed(distances.size());
  if (matching == HandMatching::kIndependentSequence || matching == HandMatching::kSourceSequence) {
    HandDistances sum = HandDistances::Zero();
    for (const HandDistances& d : distances) sum += d;
    crossed.assign(distances.size(), crossed_by_sum(sum));
    return crossed;
  }
  const bool bottleneck = matching == HandMatching::kIndependentBottleneck;
  for (size_t t = 0; t < distances.size(); ++t)
    crossed[t] = bottleneck ? crossed_by_max(distances[t]) : crossed_by_sum(distances[t]);
  return crossed;
}

void drop_short_runs(FrameMask& contact, int min_frames) {
  size_t begin = 0;
  while (begin < contact.size()) {
    size_t end = begin;
    while (end < contact.size() && contact[end]) ++end;
    if (end - begin < static_cast<size_t>(min_frames))
      std::fill(contact.begin() + static_cast<long>(begin), contact.begin() + static_cast<long>(end), false);
    begin = end + 1;
  }
}

// Contact of the initiator's left and right hand per frame.
std::array<FrameMask, 2> contacts(const std::vector<HandDistances>& distances, const FrameMask& crossed,
                                  double threshold, const MetricReadings& readings) {
  std::array<FrameMask, 2> result;
  for (int hand = 0; hand < 2; ++hand) {
    FrameMask& contact = result[hand];
    contact.resize(distances.size());
    for (size_t t = 0; t < distances.size(); ++t) {
      const double d = distances[t](hand, crossed[t] ? 1 - hand : hand);
      contact[t] = readings.contact_compare == Compare::kLt ? d < threshold : d <= threshold;
    }
    drop_short_runs(contact, readings.min_frames);
  }
  return result;
}

void check(const PointTracks& hands, const PointTracks& first, const char* name) {
  const std::string what = std::string("contact_counts: ") + name;
  require_finite(hands, what);
  require(hands.points() == 2, "{} has {} points, expected 2 hands", what, hands.points());
  require_same_shape(hands, first, what, "source_initiator");
}

double ratio(double part, double whole, ZeroDivision zero_division) {
  if (whole > 0.0) return part / whole;
  switch (zero_division) {
    case ZeroDivision::kZero:
      return 0.0;
    case ZeroDivision::kOne:
      return 1.0;
    case ZeroDivision::kNan:
      break;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

ContactCounts& ContactCounts::operator+=(const ContactCounts& other) {
  tp += other.tp;
  fp += other.fp;
  fn += other.fn;
  tn += other.tn;
  return *this;
}

ContactCounts contact_counts(const PointTracks& source_initiator, const PointTracks& source_responder,
                             const PointTracks& new_initiator, const PointTracks& robot, double threshold,
                             const MetricReadings& readings) {
  check(source_initiator, source_initiator, "source_initiator");
  check(source_responder, source_initiator, "source_responder");
  check(new_initiator, source_initiator, "new_initiator");
  check(robot, source_initiator, "robot");
  require(std::isfinite(threshold) && threshold > 0.0, "contact_counts: the threshold must be positive, found {}",
          threshold);
  require(readings.min_frames >= 1, "contact_counts: min_frames must be 1 or more, found {}", readings.min_frames);

  const std::vector<HandDistances> source = hand_distances(source_initiator, source_responder);
  const std::vector<HandDistances> after = hand_distances(new_initiator, robot);
  const FrameMask source_crossed = crossed_frames(source, readings.matching);
  const bool own =
      readings.matching != HandMatching::kSourceFrame && readings.matching != HandMatching::kSourceSequence;
  const std::array<FrameMask, 2> truth = contacts(source, source_crossed, threshold, readings);
  const std::array<FrameMask, 2> found =
      contacts(after, own ? crossed_frames(after, readings.matching) : source_crossed, threshold, readings);

  ContactCounts counts;
  for (int hand = 0; hand < 2; ++hand)
    for (size_t t = 0; t < source.size(); ++t)
      ++(truth[hand][t] ? (found[hand][t] ? counts.tp : counts.fn) : (found[hand][t] ? counts.fp : counts.tn));
  return counts;
}

// F1 from the counts, so that it is 0 rather than undefined where only one of precision and recall is undefined.
Classification classification(const ContactCounts& counts, ZeroDivision zero_division) {
  const auto tp = static_cast<double>(counts.tp);
  const auto fp = static_cast<double>(counts.fp);
  const auto fn = static_cast<double>(counts.fn);
  const auto tn = static_cast<double>(counts.tn);
  return {.precision = ratio(tp, tp + fp, zero_division),
          .recall = ratio(tp, tp + fn, zero_division),
          .f1 = ratio(2.0 * tp, 2.0 * tp + fp + fn, zero_division),
          .accuracy = ratio(tp + tn, tp + fp + fn + tn, zero_division)};
}

// JPE and AWD: how far the robot's geometry is from the source's.

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

// Motion smoothness: the third derivative of positions.
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
