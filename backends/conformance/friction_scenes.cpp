// Friction of the pair: slip angle, sliding, rolling.
#include <fmt/format.h>

#include <cmath>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"

namespace duet::conformance {
namespace {

struct Direction {
  const char* name;
  Eigen::Vector3d d_W;
};

const Direction kDirections[] = {{"x", Eigen::Vector3d::UnitX()},
                                 {"y", Eigen::Vector3d::UnitY()},
                                 {"the diagonal", Eigen::Vector3d(1.0, 1.0, 0.0).normalized()}};

constexpr double kSettle = 0.3, kWatch = 0.2;  // [s]

struct Slide {
  double acceleration = 0.0;  // down the slope, mean over kWatch after kSettle [m/s^2]
  double speed = 0.0;         // at the end [m/s]
  double cost = 0.0;
};

// The sledge on a slope of this angle [rad]: gravity is tilted, not the ground.
Slide slide_on(const Trial& trial, double friction, double angle, const Eigen::Vector3d& down_W) {
  Scene scene = trial.scene(sledge(), trial.dt());
  scene.friction.robot_ground = friction;
  scene.gravity = kGravity * (std::sin(angle) * down_W - std::cos(angle) * Eigen::Vector3d::UnitZ());
  World world(trial, scene);
  const JointCommand command = no_torque(world.robot());
  world.reset(state_at(world.robot(), {0.0, 0.0, kSledgeHeight}));
  world.run(kSettle, command);
  const double before = world.state().v_WB.dot(down_W);
  world.run(kWatch, command);
  const double after = world.state().v_WB.dot(down_W);
  return {(after - before) / kWatch, after, world.cost()};
}

// Tangent of the angle from which the sledge gains speed, by bisection in +-10 % of the friction coefficient.
double slip_tangent(const Trial& trial, double friction, const Eigen::Vector3d& down_W) {
  constexpr double kGains = 0.002 * kGravity;  // 0.4 % beyond the slip angle of 0.5
  double holds = 0.9 * friction, slips = 1.1 * friction;
  const int halvings = trial.full() ? 8 : 5;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (holds + slips);
    (slide_on(trial, friction, std::atan(middle), down_W).acceleration > kGains ? slips : holds) = middle;
  }
  return 0.5 * (holds + slips);
}

}  // namespace

void measure_incline(Trial& trial) {
  const double dt = trial.dt();
  for (const double friction : {0.3, 0.8})
    for (const Direction& direction : kDirections) {
      const auto name = [&](const char* what) {
        return fmt::format("{}, friction {}, along {}", what, friction, direction.name);
      };
      trial.relative(name("tangent of the slip angle"), "", dt, slip_tangent(trial, friction, direction.d_W), friction,
                     0.02, "the friction of the pair");
      const double held = std::atan(0.98 * friction), steep = std::atan(1.5 * friction);
      const Slide creep = slide_on(trial, friction, held, direction.d_W);
      trial.at_most(name("speed below the slip angle"), "m/s", dt, std::abs(creep.speed), 1e-3,
                    "2 % below it, after 0.5 s: creep");
      const Slide slide = slide_on(trial, friction, steep, direction.d_W);
      trial.relative(name("acceleration of sliding"), "m/s^2", dt, slide.acceleration,
                     kGravity * (std::sin(steep) - friction * std::cos(steep)), 0.02,
                     "at 1.5 times the slip tangent: g (sin - mu cos)");
    }
}

namespace {

constexpr double kBallMass = 1.0, kBallRadius = 0.1, kBallSpeed = 1.0, kBallFriction = 0.3;

struct Roll {
  double transition = 0.0;  // [s]
  RobotState end;
  double cost = 0.0;
};

double slip_speed(const RobotState& state, const Eigen::Vector3d& along_W) {
  const Eigen::Vector3d w_W = state.X_WB.R * state.w_WB_B;
  const Eigen::Vector3d contact = state.v_WB + w_W.cross(Eigen::Vector3d(0.0, 0.0, -kBallRadius));
  return contact.dot(along_W);
}

// Sliding without spin at first. The transition is found from the time at which 90 % of the slip is gone: slip falls
// linearly, and the last part is where soft friction has its tail.
Roll roll(const Trial& trial, double dt, const Eigen::Vector3d& along_W) {
  Scene scene = trial.scene(ball(kBallMass, kBallRadius), dt);
  scene.friction.robot_ground = kBallFriction;
  World world(trial, scene);
  const JointCommand command = no_torque(world.robot());
  world.reset(state_at(world.robot(), {0.0, 0.0, kBallRadius}));
  world.run(0.3, command);
  RobotState start = world.state();
  start.v_WB = kBallSpeed * along_W;
  start.w_WB_B.setZero();
  world.reset(start);
  Roll found;
  double previous = kBallSpeed;
  const int steps = steps_in(0.4, dt);
  for (int i = 0; i < steps; ++i) {
    world.step(command);
    const double slip = slip_speed(world.state(), along_W);
    if (found.transition == 0.0 && slip < 0.1 * kBallSpeed)
      found.transition = (world.time() - dt * (0.1 * kBallSpeed - slip) / (previous - slip)) / 0.9;
    previous = slip;
  }
  found.end = world.state();
  found.cost = world.cost();
  return found;
}

}  // namespace

void measure_rolling_ball(Trial& trial) {
  const double dt = trial.dt(), rolling = 5.0 / 7.0 * kBallSpeed;
  for (const Direction& direction : {kDirections[0], kDirections[2]}) {
    const auto name = [&](const char* what) { return fmt::format("{} along {}", what, direction.name); };
    const Roll found = roll(trial, dt, direction.d_W);
    trial.relative(name("final speed"), "m/s", dt, found.end.v_WB.dot(direction.d_W), rolling, 0.005,
                   "5/7 of the first");
    trial.at_most(name("final slip"), "m/s", dt, std::abs(slip_speed(found.end, direction.d_W)), 1e-3, "it rolls");
    trial.at_most(name("sideways speed"), "m/s", dt,
                  std::abs(found.end.v_WB.dot(Eigen::Vector3d::UnitZ().cross(direction.d_W))), 1e-3,
                  "friction is against the slip, not along an axis of the solver");
    trial.relative(name("time to roll"), "s", dt, found.transition, 2.0 * kBallSpeed / (7.0 * kBallFriction * kGravity),
                   0.02, "2 v0 / (7 mu g), from where 90 % of the slip is gone");
  }
  for (const double step : trial.step_sizes()) {
    const Roll found = roll(trial, step, kDirections[2].d_W);
    trial.dot("error of the speed of rolling along the diagonal", "m/s", step,
              std::abs(found.end.v_WB.dot(kDirections[2].d_W) - rolling), found.cost);
  }
}

}  // namespace duet::conformance
