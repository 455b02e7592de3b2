// The G1 of the project and seeded motions and references for the tests of policies.
#pragma once

#include <algorithm>
#include <memory>
#include <numbers>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/recording.h"
#include "duet/policies/policy.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/roles.h"

namespace duet::test {

// Rounding of a few products and sums of numbers near 1.
inline constexpr double kAlgebra = 1e-13;

inline std::shared_ptr<const RobotModel> g1() {
  static const auto robot = load_shared_robot();
  return robot;
}

inline std::shared_ptr<const RobotModel> t1() {
  static const auto robot = load_shared_robot("t1");
  return robot;
}

// Whether a joint belongs to a leg of the G1.
inline bool is_leg(int joint) {
  const std::vector<int> legs = leg_joints(*g1());
  return std::find(legs.begin(), legs.end(), joint) != legs.end();
}

inline Eigen::Quaterniond random_rotation(Random& random) {
  return Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()).normalized();
}

// Heading anywhere, tilt up to `tilt` [rad].
inline Eigen::Quaterniond random_upright(Random& random, double tilt) {
  const double direction = random.uniform(-std::numbers::pi, std::numbers::pi);
  const Eigen::Vector3d axis(std::cos(direction), std::sin(direction), 0.0);
  return yaw_rotation(random.uniform(-std::numbers::pi, std::numbers::pi)) *
         Eigen::AngleAxisd(random.uniform(0.0, tilt), axis);
}

inline Reference random_reference(Random& random, int joints) {
  Reference reference{{random_upright(random, 0.5), {random.normal(), random.normal(), 0.8}}, Eigen::VectorXd(joints)};
  for (double& angle : reference.q) angle = random.uniform(-1.0, 1.0);
  return reference;
}

inline Anchors random_anchors(Random& random, int joints) {
  Anchors anchors;
  for (Reference& anchor : anchors) anchor = random_reference(random, joints);
  return anchors;
}

// A smooth motion of the G1 inside its limits: joints swing, the root walks along x, turns and leans forward.
inline RobotMotion swinging_motion(int frames, std::uint64_t seed) {
  const RobotModel& robot = *g1();
  Random random(seed, 1);
  RobotMotion motion{50.0, robot.joint_names(), std::vector<Pose>(frames), Eigen::MatrixXd(robot.dof(), frames)};
  for (int j = 0; j < robot.dof(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    const double phase = random.uniform(0.0, 6.0), rate = random.uniform(0.5, 3.0);
    for (int t = 0; t < frames; ++t)
      motion.q(j, t) =
          0.5 * (joint.lower + joint.upper) + 0.49 * (joint.upper - joint.lower) * std::sin(phase + rate * t / 50.0);
  }
  const double x = random.normal(), y = random.normal(), yaw = random.uniform(-3.0, 3.0);
  for (int t = 0; t < frames; ++t) {
    const double s = t / 50.0;
    motion.root[static_cast<std::size_t>(t)] = {
        yaw_rotation(yaw + 0.3 * s) * Eigen::AngleAxisd(0.3 + 0.2 * std::sin(s), Eigen::Vector3d::UnitY()),
        {x + 0.4 * s, y, 0.7 + 0.02 * std::sin(3.0 * s)}};
  }
  return motion;
}

}  // namespace duet::test
