// Physical plausibility: magnitudes of joint rotations, how often they are large and how they spread.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "duet/core/require.h"
#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"

namespace duet {
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

}  // namespace duet
