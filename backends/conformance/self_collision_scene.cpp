// A hand sent into the trunk, without gravity: the pair stops it and leaves the robot's momentum alone.
#include <algorithm>
#include <limits>

#include "backends/conformance/reference.h"
#include "backends/conformance/scenes.h"
#include "backends/conformance/small_robots.h"
#include "backends/conformance/trial.h"
#include "backends/narrow_phase.h"

namespace duet::conformance {
namespace {

constexpr double kSeconds = 1.0;

// Deepest overlap of the declared pairs. [m]
double deepest_pair(const Scene& scene, const RobotState& state) {
  NarrowPhase narrow_phase(scene);
  Kinematics kinematics(*scene.robot);
  kinematics.update(state.X_WB, state.q);
  double depth = 0.0;
  for (const ContactPoint& point : narrow_phase.collide(kinematics, {}))
    if (point.side == ContactSide::kRobot) depth = std::max(depth, point.depth);
  return depth;
}

// The left hand in front of the trunk, and from there into it.
Eigen::VectorXd hand_pose(const RobotModel& robot, double inward) {
  Eigen::VectorXd q = robot.neutral;
  q[robot.joint_index("left_shoulder_pitch_joint")] = 0.2;
  q[robot.joint_index("left_shoulder_roll_joint")] = 0.3;
  q[robot.joint_index("left_elbow_joint")] = 0.6;
  q[robot.joint_index("left_shoulder_yaw_joint")] = inward;
  return q;
}

}  // namespace

void measure_self_collision(Trial& trial) {
  const double dt = trial.dt();
  Scene scene = trial.scene(trial.g1(), dt);
  scene.gravity.setZero();
  scene.self_collision = true;
  const RobotModel& robot = *scene.robot;
  RobotState start = state_at(robot, {0.0, 0.0, 50.0});
  start.q = hand_pose(robot, 0.0);
  RobotState sent = start;
  sent.q = hand_pose(robot, -1.2);
  trial.at_most("overlap at the start", "m", dt, deepest_pair(scene, start), 0.0, "of the scene itself");
  const double commanded = deepest_pair(scene, sent);

  World world(trial, scene);
  world.reset(start);
  const JointCommand command = robot.default_command(sent.q);
  double deepest = 0.0, force = 0.0, linear = 0.0;
  for (int i = 0; i < steps_in(kSeconds, dt); ++i) {
    world.step(command);
    deepest = std::max(deepest, deepest_pair(scene, world.state()));
    force = world.force_of(ContactSide::kRobot).norm();
    linear = std::max(linear, momentum_of(robot, world.state()).linear.norm());
  }
  trial.at_most("share of the commanded overlap", "", dt, deepest / commanded, 0.2,
                "deepest over 1 s; the target lies centimetres inside the trunk");
  trial.absolute("force of the pair at the end", "N", dt, force > 1.0 ? 1.0 : 0.0, 1.0, 0.0,
                 "more than 1 N is reported");
  trial.at_most("linear momentum", "N s", dt, linear, 200.0 * dt, "largest; it was zero, as in the scene momentum");
}

}  // namespace duet::conformance
