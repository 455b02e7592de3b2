#include "duet/formats/motion_support.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

constexpr int kSupportFrames = 60;      // that are looked at
constexpr double kNearLimit = 0.1;      // [rad] beyond the card's limits that still counts as inside
constexpr double kMostlyInside = 0.98;  // recordings of the right order have 99.5 % and more
constexpr double kNearFloor = 0.04;     // [m]: PBHC's motions, which are right, stand 0.039 m too low
constexpr double kFlat = 0.3;           // [rad]
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// The lower foot: its lowest point, and the tilt of the points of its sole.
struct LowerFoot {
  double height = std::numeric_limits<double>::infinity(), tilt = 0.0;
};

LowerFoot lower_foot(const RobotModel& robot, const Kinematics& kinematics) {
  LowerFoot foot;
  int link = -1;
  for (const int shape : robot.feet) {
    const double z = kinematics.shape_position(shape).z() - robot.shapes[static_cast<std::size_t>(shape)].radius;
    if (z >= foot.height) continue;
    foot.height = z;
    link = robot.shapes[static_cast<std::size_t>(shape)].link;
  }
  for (const int a : robot.feet) {
    for (const int b : robot.feet) {
      if (robot.shapes[static_cast<std::size_t>(a)].link != link ||
          robot.shapes[static_cast<std::size_t>(b)].link != link)
        continue;
      const Eigen::Vector3d span = kinematics.shape_position(a) - kinematics.shape_position(b);
      if (span.norm() > 0.0)
        foot.tilt = std::max(foot.tilt, std::asin(std::min(1.0, std::abs(span.z()) / span.norm())));
    }
  }
  return foot;
}

}  // namespace

bool MotionSupport::fits_limits() const { return inside >= kMostlyInside; }

int MotionSupport::doubts() const {
  return (fits_limits() ? 0 : 1) + (std::abs(sole) > kNearFloor ? 1 : 0) + (tilt > kFlat ? 1 : 0);
}

std::string MotionSupport::text() const {
  std::string words = fmt::format("within the limits {:.1f} %", 100.0 * inside);
  if (!std::isnan(sole))
    words += fmt::format(", lower sole at {:.3f} m, tilted by {:.0f} degrees", sole, tilt * 180.0 / std::numbers::pi);
  return words;
}

MotionSupport support_of(const RobotModel& robot, const RobotMotion& motion) {
  Kinematics kinematics(robot);
  std::vector<double> heights, tilts;
  double inside = 0.0, all = 0.0;
  for (int t = 0; t < motion.frames(); t += std::max(1, motion.frames() / kSupportFrames)) {
    for (int j = 0; j < robot.dof(); ++j) {
      const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
      const double q = motion.q(j, t);
      inside += q >= joint.lower - kNearLimit && q <= joint.upper + kNearLimit ? 1.0 : 0.0;
      all += 1.0;
    }
    if (robot.feet.empty()) continue;
    kinematics.update(motion.root[static_cast<std::size_t>(t)], motion.q.col(t));
    const LowerFoot foot = lower_foot(robot, kinematics);
    heights.push_back(foot.height);
    tilts.push_back(foot.tilt);
  }
  MotionSupport support{.inside = all > 0.0 ? inside / all : 1.0, .sole = kUnknown, .tilt = kUnknown};
  if (heights.empty()) return support;
  support.sole = quantile(std::move(heights), 0.5);
  support.tilt = quantile(std::move(tilts), 0.5);
  return support;
}

double share_too_quick(const RobotModel& robot, const RobotMotion& motion) {
  int quick = 0;
  const int steps = motion.frames() - 1;
  for (int t = 0; t < steps; ++t) {
    const Eigen::ArrayXd speed = (motion.q.col(t + 1) - motion.q.col(t)).array().abs() * motion.rate_hz;
    bool any = false;
    for (int j = 0; j < robot.dof(); ++j) {
      const double limit = robot.joints[static_cast<std::size_t>(j)].velocity;
      any = any || (limit > 0.0 && speed[j] > limit);
    }
    quick += any ? 1 : 0;
  }
  return steps > 0 ? static_cast<double>(quick) / steps : 0.0;
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& R) {
  const double sign = R.w() < 0.0 ? -1.0 : 1.0;
  const double sine = R.vec().norm();
  constexpr double kSmall = 1e-9;  // below it the angle is twice the vector part to the last bit
  if (sine < kSmall) return 2.0 * sign * R.vec();
  return (2.0 * sign * std::atan2(sine, sign * R.w()) / sine) * R.vec();
}

Eigen::MatrixXd rate_of_change(const Eigen::MatrixXd& values, double rate_hz) {
  const Eigen::Index frames = values.cols();
  Eigen::MatrixXd rate(values.rows(), frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Index before = std::max<Eigen::Index>(t - 1, 0), after = std::min(t + 1, frames - 1);
    rate.col(t) = (values.col(after) - values.col(before)) * (rate_hz / static_cast<double>(after - before));
  }
  return rate;
}

Eigen::MatrixXd angular_velocity(const std::vector<Eigen::Quaterniond>& R_WB, double rate_hz) {
  const auto frames = static_cast<Eigen::Index>(R_WB.size());
  Eigen::MatrixXd w(3, frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Index middle = std::clamp<Eigen::Index>(t, 1, std::max<Eigen::Index>(frames - 2, 1));
    const Eigen::Index after = std::min(middle + 1, frames - 1);
    const Eigen::Quaterniond turn =
        R_WB[static_cast<std::size_t>(after)] * R_WB[static_cast<std::size_t>(middle - 1)].conjugate();
    w.col(t) = rotation_vector(turn) * (rate_hz / static_cast<double>(after - middle + 1));
  }
  return w;
}

LinkMotion link_motion(const RobotModel& robot, const RobotMotion& motion, const std::vector<int>& links) {
  const auto bodies = static_cast<Eigen::Index>(links.size()), frames = static_cast<Eigen::Index>(motion.frames());
  LinkMotion result;
  result.position.resize(3 * bodies, frames);
  result.quat_wxyz.resize(4 * bodies, frames);
  result.angular_velocity.resize(3 * bodies, frames);
  std::vector<std::vector<Eigen::Quaterniond>> rotations(links.size());
  Kinematics kinematics(robot);
  for (int t = 0; t < motion.frames(); ++t) {
    kinematics.update(motion.root[static_cast<std::size_t>(t)], motion.q.col(t));
    for (Eigen::Index b = 0; b < bodies; ++b) {
      const Pose X_WL = kinematics.X_WL(links[static_cast<std::size_t>(b)]);
      result.position.block<3, 1>(3 * b, t) = X_WL.p;
      result.quat_wxyz.block<4, 1>(4 * b, t) << X_WL.R.w(), X_WL.R.x(), X_WL.R.y(), X_WL.R.z();
      rotations[static_cast<std::size_t>(b)].push_back(X_WL.R);
    }
  }
  result.velocity = rate_of_change(result.position, motion.rate_hz);
  for (Eigen::Index b = 0; b < bodies; ++b)
    result.angular_velocity.middleRows<3>(3 * b) =
        angular_velocity(rotations[static_cast<std::size_t>(b)], motion.rate_hz);
  return result;
}

}  // namespace duet
