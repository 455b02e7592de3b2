// Scenes that check what the engine makes of a state: kinematics and instantaneous accelerations.
#include <algorithm>
#include <cmath>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/narrow_phase.h"

namespace duet::conformance {
namespace {

constexpr double kHigh = 50.0;          // of the base where nothing must touch [m]
constexpr double kShare = 0.7;          // of the joint ranges that random states use
constexpr double kRoundTrip = 1e-12;    // algebra on numbers of order 50 m
constexpr double kRestVelocity = 1e-9;  // a round trip's error over dt
constexpr double kTinyStep = 1e-6;      // [s]
constexpr double kContactStep = 1e-4;   // [s]

double pose_error(const RobotState& a, const RobotState& b) {
  return std::max(
      {(a.X_WB.p - b.X_WB.p).cwiseAbs().maxCoeff(), a.X_WB.R.angularDistance(b.X_WB.R), largest_joint_error(a, b)});
}

double velocity_error(const RobotState& a, const RobotState& b) {
  return std::max({(a.v_WB - b.v_WB).cwiseAbs().maxCoeff(), (a.w_WB_B - b.w_WB_B).cwiseAbs().maxCoeff(),
                   (a.v - b.v).cwiseAbs().maxCoeff()});
}

// At rest without gravity a step changes nothing, so what comes back is what was set.
void measure_rest(Trial& trial, Random& random) {
  Scene scene = trial.scene(trial.robot(), trial.dt());
  scene.gravity.setZero();
  World world(trial, scene);
  double pose = 0.0, velocity = 0.0;
  for (int i = 0; i < 20; ++i) {
    const RobotState state = random_state(world.robot(), {1.0, -2.0, kHigh}, kShare, 0.0, random);
    world.reset(state);
    world.step(no_torque(world.robot()));
    pose = std::max(pose, pose_error(world.state(), state));
    velocity = std::max(velocity, velocity_error(world.state(), state));
  }
  trial.at_most("pose after a step at rest", "m, rad", trial.dt(), pose, kRoundTrip,
                "20 random poses set, stepped without forces and read back");
  trial.at_most("velocity after a step at rest", "m/s, rad/s", trial.dt(), velocity, kRestVelocity,
                "the same poses; zero was set");
}

// Contact points show where the engine has each link: they are compared with those of our kinematics.
void measure_contact_points(Trial& trial, Random& random) {
  World world(trial, trial.scene(trial.robot(), kContactStep));
  NarrowPhase expected(world.backend().scene());
  Kinematics kinematics(world.robot());
  double worst = 0.0;
  for (int i = 0; i < 10; ++i) {
    RobotState state = random_state(world.robot(), {0.3, 0.2, kHigh}, kShare, 0.0, random);
    kinematics.update(state.X_WB, state.q);
    double lowest = kHigh;
    for (std::size_t s = 0; s < world.robot().shapes.size(); ++s) {
      const RobotShape& shape = world.robot().shapes[s];
      const Eigen::Vector3d axis = kinematics.R_WL(shape.link) * (shape.X_LS.R * Eigen::Vector3d::UnitZ());
      lowest = std::min(lowest, kinematics.shape_position(static_cast<int>(s)).z() - shape.radius -
                                    shape.half_length * std::abs(axis.z()));
    }
    state.X_WB.p.z() -= lowest + 1e-3;
    world.reset(state);
    world.step(no_torque(world.robot()));
    kinematics.update(state.X_WB, state.q);
    const auto points = expected.collide(kinematics, {});
    const auto contacts = world.backend().contacts();
    if (points.size() != contacts.size()) {
      worst = std::numeric_limits<double>::quiet_NaN();
      break;
    }
    for (std::size_t k = 0; k < points.size(); ++k)
      worst =
          std::max({worst, (points[k].p_W - contacts[k].p_WC).norm(), std::abs(points[k].depth - contacts[k].depth)});
  }
  trial.at_most("contact point against our kinematics", "m", kContactStep, worst, 1e-9,
                "10 random poses 1 mm in the ground; the same number, links, points and depths");
}

}  // namespace

void measure_state(Trial& trial) {
  Random random(3, 1);
  measure_rest(trial, random);
  measure_contact_points(trial, random);
}

void measure_acceleration(Trial& trial) {
  Random random(3, 2);
  World world(trial, trial.scene(trial.robot(), kTinyStep));
  const RobotModel& robot = world.robot();
  Dynamics dynamics(robot, world.backend().scene().gravity);
  double worst = 0.0;
  for (int i = 0; i < (trial.full() ? 30 : 10); ++i) {
    const RobotState state = random_state(robot, {0.0, 0.0, kHigh}, kShare, 1.5, random);
    JointCommand command = no_torque(robot);
    for (double& torque : command.tau_ff) torque = random.uniform(-3.0, 3.0);
    Eigen::VectorXd Q = Eigen::VectorXd::Zero(6 + robot.dof());
    Q.tail(robot.dof()) = command.tau_ff;
    const Eigen::VectorXd expected = acceleration(dynamics, state, Q);
    world.reset(state);
    world.step(command);
    Eigen::VectorXd found(6 + robot.dof());
    found << world.state().v_WB - state.v_WB, world.state().w_WB_B - state.w_WB_B, world.state().v - state.v;
    worst = std::max(worst, (found / kTinyStep - expected).norm() / expected.norm());
  }
  trial.at_most("error of the acceleration, relative", "", kTinyStep, worst, 1e-6,
                "(v+ - v) / dt against mass matrix and Newton-Euler of our own; differences cost about 1e-7");
}

}  // namespace duet::conformance
