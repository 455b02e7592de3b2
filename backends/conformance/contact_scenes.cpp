// Scenes of contact: bounce, friction, and a hand against the trunk.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/narrow_phase.h"
#include "duet/core/recording.h"

namespace duet::conformance {

// A ball on the skin of a held human capsule, and on the ground.

namespace {

constexpr double kMass = 10.0, kRadius = 0.1, kImpactSpeed = 1.0;
constexpr double kCapsuleRadius = 0.05, kGap = 1e-3;
constexpr double kSkinStiffness = 25000.0;
constexpr double kCapsuleHeight = 50.0;  // away from the ground

struct Bounce {
  double speed = 0.0;  // after, of the ball less that of the skin [m/s]
  double contact_time = 0.0, peak = 0.0, cost = 0.0;
};

// The linearly implicit step on one unilateral spring and damper, which every engine has to make of a skin:
// f = -K r - (D + dt K) v+, not negative.
Bounce discrete_bounce(const ContactCompliance& skin, double dt) {
  Bounce bounce;
  double r = kGap, v = -kImpactSpeed;
  for (int i = 0; i < steps_in(0.2, dt); ++i) {
    if (r < 0.0) {
      const double damping = skin.damping + dt * skin.stiffness;
      const double f = std::max(0.0, -(skin.stiffness * r + damping * v) / (1.0 + dt * damping / kMass));
      v += dt * f / kMass;
      if (f > 0.0) bounce.contact_time += dt;
      bounce.peak = std::max(bounce.peak, f);
    }
    r += dt * v;
  }
  bounce.speed = v;
  return bounce;
}

// `skin_speed`: of the capsule towards the ball, whose speed is the rest of kImpactSpeed [m/s].
Bounce bounce_in(const Trial& trial, const ContactCompliance& skin, double dt, double skin_speed = 0.0) {
  Scene scene = trial.scene(ball(kMass, kRadius), dt);
  scene.gravity.setZero();
  scene.partner = PartnerMode::kSolid;
  HumanCapsule capsule;
  capsule.name = "held";
  capsule.region = "chest";
  capsule.joint_a = kLeftHip;
  capsule.joint_b = kRightHip;
  capsule.radius = kCapsuleRadius;
  capsule.skin = skin;
  scene.human.capsules = {capsule};
  World world(trial, scene);
  RobotState start = state_at(world.robot(), {0.0, 0.0, kCapsuleHeight});
  start.v_WB.x() = skin_speed - kImpactSpeed;
  world.reset(start);
  HumanJoints joints = HumanJoints::Zero();
  joints.colwise() = Eigen::Vector3d(-(kRadius + kCapsuleRadius + kGap), 0.0, kCapsuleHeight);
  joints(1, kLeftHip) = 0.5;
  joints(1, kRightHip) = -0.5;
  HumanJoints velocities = HumanJoints::Zero();
  velocities.row(0).setConstant(skin_speed);
  world.backend().set_partner(joints, velocities);
  const JointCommand command = no_torque(world.robot());
  Bounce bounce;
  for (int i = 0; i < steps_in(0.2, dt); ++i) {
    world.step(command);
    const double f = world.force_of(ContactSide::kHuman).x();
    if (f > 0.0) bounce.contact_time += dt;
    bounce.peak = std::max(bounce.peak, f);
  }
  bounce.speed = world.state().v_WB.x() - skin_speed;
  bounce.cost = world.cost();
  return bounce;
}

// Restitution of a unilateral spring and damper (no pull): Schwager and Poeschel, Granular Matter 9 (2007), eq. 21.
double restitution(const ContactCompliance& skin) {
  const double beta = 0.5 * skin.damping / kMass;
  const double omega = std::sqrt(skin.stiffness / kMass - beta * beta);
  return std::exp(-beta / omega * (std::numbers::pi - std::atan2(2.0 * beta * omega, omega * omega - beta * beta)));
}

}  // namespace

void measure_skin_bounce(Trial& trial) {
  const double natural = std::sqrt(kSkinStiffness / kMass);
  for (const double damping : {0.0, 200.0}) {
    const ContactCompliance skin{.stiffness = kSkinStiffness, .damping = damping};
    const auto name = [&](const char* what) {
      return fmt::format("{} skin: {}", damping == 0.0 ? "undamped" : "damped", what);
    };
    for (const double dt : trial.step_sizes()) {
      const Bounce found = bounce_in(trial, skin, dt), discrete = discrete_bounce(skin, dt);
      const double implicit = 0.5 * std::numbers::pi * natural * dt;  // what the implicit step damps in half a swing
      trial.relative(name("speed after against the implicit step"), "m/s", dt, found.speed, discrete.speed, 1e-3,
                     "linearly implicit step of the same spring and damper");
      trial.relative(name("peak force against the implicit step"), "N", dt, found.peak, discrete.peak, 1e-3,
                     "the same");
      const Bounce struck = bounce_in(trial, skin, dt, kImpactSpeed);
      trial.relative(name("speed from a moving skin, less the skin's"), "m/s", dt, struck.speed, discrete.speed, 1e-3,
                     "the same: a ball at rest, the skin comes");
      trial.relative(name("peak force of a moving skin"), "N", dt, struck.peak, discrete.peak, 1e-3, "the same");
      trial.absolute(name("contact time against the implicit step"), "s", dt, found.contact_time, discrete.contact_time,
                     0.5 * dt, "the same number of steps");
      trial.relative(name("restitution"), "", dt, found.speed / kImpactSpeed, restitution(skin), 1.2 * implicit,
                     "of the spring and damper; the implicit step damps pi omega dt / 2 more");
      if (damping == 0.0) {
        trial.relative(name("peak force"), "N", dt, found.peak, kImpactSpeed * kMass * natural, implicit,
                       "v sqrt(m K)");
        trial.absolute(name("contact time"), "s", dt, found.contact_time, std::numbers::pi / natural, 2.0 * dt,
                       "pi sqrt(m / K), counted in steps");
        trial.dot("error of the restitution on an undamped skin", "", dt, std::abs(found.speed / kImpactSpeed - 1.0),
                  found.cost);
      }
    }
  }
}

void measure_ground_bounce(Trial& trial) {
  const double drop = 0.2;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(ball(1.0, kRadius), dt));
    const JointCommand command = no_torque(world.robot());
    world.reset(state_at(world.robot(), {0.0, 0.0, kRadius + drop}));
    double highest = 0.0, deepest = 0.0;
    bool touched = false;
    for (int i = 0; i < steps_in(0.8, dt); ++i) {
      world.step(command);
      touched = touched || world.force_of(ContactSide::kGround).z() > 0.0;
      if (touched && world.state().v_WB.z() > 0.0) highest = std::max(highest, world.state().X_WB.p.z() - kRadius);
    }
    for (const Contact& contact : world.backend().contacts()) deepest = std::max(deepest, contact.depth);
    trial.at_most("energy given back", "", dt, highest / drop, 0.01, "height after the impact over 0.2 m");
    trial.at_most("depth at rest", "m", dt, deepest, 1e-3, "0.6 s after the impact");
    trial.relative("force at rest", "N", dt, world.force_of(ContactSide::kGround).z(), kGravity, 1e-3, "m g");
  }
}

// Friction of the pair: slip angle, sliding, rolling.

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

// A hand sent into the trunk, without gravity: the pair stops it and leaves the robot's momentum alone.

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
