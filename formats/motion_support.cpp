#include "duet/formats/motion_support.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "duet/core/order_statistics.h"
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

}  // namespace duet
