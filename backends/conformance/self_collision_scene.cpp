// A hand sent into the trunk, without gravity: the pair stops it and leaves the robot's momentum alone.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/narrow_phase.h"

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

constexpr const char* kHandBefore = "hand_before_trunk";  // poses of the card: the hand in front of the trunk,
constexpr const char* kHandInside = "hand_in_trunk";      // and where it is sent

}  // namespace

std::string lacks_hand_poses(const RobotModel& robot) {
  for (const char* name : {kHandBefore, kHandInside})
    if (robot.pose(name) == nullptr) return fmt::format("the card of robot '{}' has no pose '{}'", robot.name, name);
  return "";
}

void measure_self_collision(Trial& trial) {
  const double dt = trial.dt();
  Scene scene = trial.scene(trial.robot(), dt);
  scene.gravity.setZero();
  scene.self_collision = true;
  const RobotModel& robot = *scene.robot;
  RobotState start = state_at(robot, {0.0, 0.0, 50.0});
  start.q = *robot.pose(kHandBefore);
  RobotState sent = start;
  sent.q = *robot.pose(kHandInside);
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
