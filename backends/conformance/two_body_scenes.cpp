// Scenes of two bodies: a hand on a partner that slides past, a hand that strikes one, a load that a moving partner
// carries along, and a forearm on a thigh of the same robot.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/trial.h"
#include "duet/core/recording.h"

namespace duet::conformance {
namespace {

constexpr double kInTheAir = 50.0;    // height of these scenes over the ground [m]
constexpr double kLimbRadius = 0.05;  // of the partner [m]
constexpr double kLimbHalfLength = 2.0;
constexpr ContactCompliance kLimbSkin = {.stiffness = 25000.0, .damping = 200.0};

// One limb of a partner, a capsule that moves along its own axis: what touches it keeps its place on it.
HumanCapsule limb(const char* name, int joint_a, int joint_b) {
  HumanCapsule capsule;
  capsule.name = name;
  capsule.region = "forearm";
  capsule.joint_a = joint_a;
  capsule.joint_b = joint_b;
  capsule.radius = kLimbRadius;
  capsule.skin = kLimbSkin;
  return capsule;
}

void lay(HumanJoints& joints, const HumanCapsule& capsule, const Eigen::Vector3d& middle_W,
         const Eigen::Vector3d& axis_W) {
  joints.col(capsule.joint_a) = middle_W + kLimbHalfLength * axis_W;
  joints.col(capsule.joint_b) = middle_W - kLimbHalfLength * axis_W;
}

// Velocities of joints that all move alike.
HumanJoints all_moving(const Eigen::Vector3d& v_W) {
  HumanJoints velocities;
  velocities.colwise() = v_W;
  return velocities;
}

// A hand under PD on a held base, with the partner's limb pressed 2 mm into it from the front.

constexpr double kPressedDepth = 0.002, kRubSpeed = 0.5;        // [m], [m/s]
constexpr double kHandStiffness = 3000.0, kHandDamping = 60.0;  // [N m/rad], [N m s/rad]
constexpr double kRubSettles = 0.2, kRubWatched = 0.1;          // [s]

struct Rub {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  // of the partner on the hand, mean [N]
  double torque = 0.0;                              // of the shoulder, mean [N m]
};

Rub rub_in(const Trial& trial, double friction, const Eigen::Vector3d& along_W) {
  Scene scene = trial.scene(held_hand(), trial.dt());
  scene.gravity.setZero();
  scene.partner = PartnerMode::kSolid;
  scene.friction = {.robot_ground = 0.05, .robot_human = friction, .robot_robot = 0.9};
  scene.human.capsules = {limb("limb", kLeftElbow, kLeftWrist)};
  World world(trial, scene);
  world.reset(state_at(world.robot(), {0.0, 0.0, kInTheAir}));
  HumanJoints joints = HumanJoints::Zero();
  lay(joints, scene.human.capsules[0], {kReach + kReachRadius + kLimbRadius - kPressedDepth, 0.0, kInTheAir}, along_W);
  world.backend().set_partner(joints, all_moving(kRubSpeed * along_W));
  JointCommand command = no_torque(world.robot());
  command.kp[0] = kHandStiffness;
  command.kd[0] = kHandDamping;
  world.run(kRubSettles, command);
  Rub found;
  const int steps = steps_in(kRubWatched, trial.dt());
  for (int i = 0; i < steps; ++i) {
    world.step(command);
    found.force += world.force_of(ContactSide::kHuman) / steps;
    found.torque += world.backend().torques()[0] / steps;
  }
  return found;
}

}  // namespace

void measure_skin_rub(Trial& trial) {
  const double dt = trial.dt(), normal = kLimbSkin.stiffness * kPressedDepth, lever = kReach + kReachRadius;
  struct Course {
    const char* name;
    double friction;
    Eigen::Vector3d d_W;
  };
  const Course courses[] = {{"up", 0.6, Eigen::Vector3d::UnitZ()},
                            {"to the left", 0.3, Eigen::Vector3d::UnitY()},
                            {"on the diagonal", 0.6, Eigen::Vector3d(0.0, 1.0, 1.0).normalized()}};
  for (const Course& course : courses) {
    const auto name = [&](const char* what) {
      return fmt::format("{}, friction {}, limb slides {}", what, course.friction, course.name);
    };
    const Rub found = rub_in(trial, course.friction, course.d_W);
    const Eigen::Vector3d across = Eigen::Vector3d::UnitX().cross(course.d_W);
    const double pressed = -found.force.x(), drag = course.friction * normal;
    trial.relative(name("normal force"), "N", dt, pressed, normal, 0.01, "K times the depth: the slip gives none");
    trial.relative(name("drag over normal force"), "", dt, found.force.dot(course.d_W) / pressed, course.friction, 0.02,
                   "the friction of the pair, along the limb's motion");
    trial.at_most(name("force across the slip"), "N", dt, std::abs(found.force.dot(across)), 0.02 * drag,
                  "friction is against the slip; 2 % of it");
    trial.absolute(name("torque of the shoulder"), "N m", dt, -found.torque, lever * drag * course.d_W.y(),
                   0.02 * lever * drag, "holds the arm against mu K depth; 2 % of the largest");
  }
}

// A hand with rotor inertia that a PD drives into the partner's limb, beside it: skin and torque law in one implicit
// step.

namespace {

constexpr double kStrikeArmature = 0.1, kStrikeSpeed = 3.0, kStrikeTarget = 0.2;  // [kg m^2], [rad/s], [rad]
constexpr double kStrikeStiffness = 200.0, kStrikeDamping = 30.0;                 // [N m/rad], [N m s/rad]
constexpr double kFirstDepth = 1e-4, kStrikeWatched = 0.03;                       // [m], [s]

struct Strike {
  double peak = 0.0, torque = 0.0, speed = 0.0;  // [N]; of the shoulder in the first step [N m]; at the end [rad/s]
};

// The recursion of both at one joint, with the lever as it is in the middle.
Strike discrete_strike(double h, double inertia) {
  const double damped = h * kStrikeDamping + h * h * kStrikeStiffness;
  const double give = h * kLimbSkin.stiffness + kLimbSkin.damping;
  Strike found;
  double q = 0.0, v = kStrikeSpeed;
  for (int i = 0; i < steps_in(kStrikeWatched, h); ++i) {
    const double depth = kFirstDepth + kReach * q;
    const double drive = kStrikeStiffness * (kStrikeTarget - q - h * v) - kStrikeDamping * v;
    const double carried = inertia + kStrikeArmature + damped;
    const bool touches = depth > 0.0;
    const double push = touches ? kLimbSkin.stiffness * depth : 0.0, resists = touches ? give : 0.0;
    const double next = (carried * v + h * (drive - kReach * push)) / (carried + h * kReach * kReach * resists);
    found.peak = std::max(found.peak, push + resists * kReach * next);
    if (i == 0) found.torque = drive - damped * (next - v) / h;
    v = next;
    q += h * v;
  }
  found.speed = v;
  return found;
}

Strike strike_in(const Trial& trial, double dt) {
  auto robot = std::make_shared<RobotModel>(*held_hand());
  robot->joints[0].armature = kStrikeArmature;
  Scene scene = trial.scene(robot, dt);
  scene.gravity.setZero();
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_human = 0.0;  // the hand turns along the limb as it goes
  scene.human.capsules = {limb("limb", kLeftElbow, kLeftWrist)};
  World world(trial, scene);
  RobotState start = state_at(world.robot(), {0.0, 0.0, kInTheAir});
  start.v[0] = kStrikeSpeed;
  world.reset(start);
  HumanJoints joints = HumanJoints::Zero();
  lay(joints, scene.human.capsules[0], {kReach, kReachRadius + kLimbRadius - kFirstDepth, kInTheAir},
      Eigen::Vector3d::UnitZ());
  world.backend().set_partner(joints, HumanJoints::Zero());
  JointCommand command = no_torque(world.robot());
  command.q_target[0] = kStrikeTarget;
  command.kp[0] = kStrikeStiffness;
  command.kd[0] = kStrikeDamping;
  Strike found;
  for (int i = 0; i < steps_in(kStrikeWatched, dt); ++i) {
    world.step(command);
    found.peak = std::max(found.peak, -world.force_of(ContactSide::kHuman).y());
    if (i == 0) found.torque = world.backend().torques()[0];
  }
  found.speed = world.state().v[0];
  return found;
}

}  // namespace

void measure_skin_strike(Trial& trial) {
  const RobotLink& arm = held_hand()->links[1];
  const double inertia = arm.inertia(2, 2) + arm.mass * kReach * kReach;
  for (const double dt : trial.step_sizes()) {
    const Strike found = strike_in(trial, dt), expected = discrete_strike(dt, inertia);
    trial.relative("peak force", "N", dt, found.peak, expected.peak, 0.005, "implicit step of skin and law together");
    trial.absolute("torque of the shoulder in the first step", "N m", dt, found.torque, expected.torque, 0.5,
                   "the same");
    trial.absolute("speed after 30 ms", "rad/s", dt, found.speed, expected.speed, 0.01, "the same");
  }
}

// A sledge on two limbs that move on under it: friction speeds it up by mu g until it moves with them.

namespace {

constexpr double kCarrySpeed = 1.0, kCarryFriction = 0.3;              // [m/s]
constexpr double kCarryFrom = 0.05, kCarryTo = 0.25, kCarryEnd = 0.6;  // [s]; it slips until 0.34 s

void put_on_limbs(World& world) {
  const Scene& scene = world.backend().scene();
  world.reset(state_at(world.robot(), {0.0, 0.0, kInTheAir}));
  const double depth = world.robot().total_mass() * kGravity / (4.0 * kLimbSkin.stiffness);
  HumanJoints joints = HumanJoints::Zero();
  for (int i = 0; i < 2; ++i)
    lay(joints, scene.human.capsules[i],
        {0.0, i == 0 ? kSledgeHalfWidth : -kSledgeHalfWidth, kInTheAir - kSledgeHeight - kLimbRadius + depth},
        Eigen::Vector3d::UnitX());
  world.backend().set_partner(joints, all_moving(kCarrySpeed * Eigen::Vector3d::UnitX()));
}

}  // namespace

void measure_skin_carry(Trial& trial) {
  const double dt = trial.dt();
  Scene scene = trial.scene(sledge(), dt);
  scene.partner = PartnerMode::kSolid;
  scene.friction = {.robot_ground = 0.05, .robot_human = kCarryFriction, .robot_robot = 0.9};
  scene.human.capsules = {limb("left", kLeftElbow, kLeftWrist), limb("right", kRightElbow, kRightWrist)};
  World world(trial, scene);
  put_on_limbs(world);
  const JointCommand command = no_torque(world.robot());
  world.run(kCarryFrom, command);
  const Eigen::Vector3d before = world.state().v_WB;
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();
  for (int i = 0; i < steps_in(kCarryTo - kCarryFrom, dt); ++i) {
    world.step(command);
    impulse += dt * world.force_of(ContactSide::kHuman);
  }
  const Eigen::Vector3d gained = world.state().v_WB - before;
  world.run(kCarryEnd - kCarryTo, command);
  trial.relative("acceleration while it slips", "m/s^2", dt,
                 (gained.x() - kCarryFriction * gained.z()) / (kCarryTo - kCarryFrom), kCarryFriction * kGravity, 0.02,
                 "mu g, less mu times what the sledge rises with");
  trial.relative("drag over normal force", "", dt, impulse.x() / impulse.z(), kCarryFriction, 0.02,
                 "the friction of the pair, of the impulses over 0.2 s");
  trial.relative("speed at the end", "m/s", dt, world.state().v_WB.x(), kCarrySpeed, 0.002,
                 "the partner's, after 0.6 s");
  trial.at_most("sideways speed", "m/s", dt, std::abs(world.state().v_WB.y()), 1e-3, "nothing pushes it aside");
}

// A forearm that a constant torque presses on a thigh, which turns under it about its own axis and is stopped.

namespace {

constexpr double kPressTorque = 6.0, kThighSpeed = 3.0, kRubFriction = 0.4;  // [N m], [rad/s]
constexpr double kBrakeFrom = 0.05, kBrakeTo = 0.2, kBrakeEnd = 0.5;         // [s]; it turns until 0.24 s or more

struct Brake {
  double normal = 0.0, drag = 0.0;  // means while it turns, of the forearm on the thigh [N]
  double slowing = 0.0, end = 0.0;  // [rad/s^2], speed at the end [rad/s]
};

Brake brake_in(const Trial& trial, double spin) {
  const double dt = trial.dt();
  Scene scene = trial.scene(forearm_on_thigh(), dt);
  scene.gravity.setZero();
  scene.self_collision = true;
  scene.friction = {.robot_ground = 0.05, .robot_human = 0.9, .robot_robot = kRubFriction};
  World world(trial, scene);
  RobotState start = state_at(world.robot(), {0.0, 0.0, kInTheAir});
  start.v[0] = spin;
  world.reset(start);
  JointCommand command = no_torque(world.robot());
  command.tau_ff[1] = kPressTorque;
  world.run(kBrakeFrom, command);
  const double before = world.state().v[0];
  Brake found;
  const int steps = steps_in(kBrakeTo - kBrakeFrom, dt);
  for (int i = 0; i < steps; ++i) {
    world.step(command);
    const Eigen::Vector3d force = world.force_of(ContactSide::kRobot);
    found.normal -= force.x() / steps;
    found.drag -= std::copysign(1.0, spin) * force.y() / steps;
  }
  found.slowing = (before - world.state().v[0]) / (kBrakeTo - kBrakeFrom);
  world.run(kBrakeEnd - kBrakeTo, command);
  found.end = world.state().v[0];
  return found;
}

}  // namespace

void measure_self_rub(Trial& trial) {
  const double dt = trial.dt();
  for (const double turns : {1.0, -1.0}) {
    const auto name = [&](const char* what) {
      return fmt::format("{}, thigh turns {}", what, turns > 0.0 ? "against the elbow" : "towards the elbow");
    };
    const Brake found = brake_in(trial, turns * kThighSpeed);
    const double normal = kPressTorque / (kForearm + turns * kRubFriction * kForearmRadius);
    const double slowing = turns * kThighRadius * kRubFriction * normal / kThighInertia;
    trial.relative(name("normal force"), "N", dt, found.normal, normal, 0.02,
                   "the elbow's torque over its lever, the friction's share taken off");
    trial.relative(name("drag over normal force"), "", dt, found.drag / found.normal, kRubFriction, 0.02,
                   "the friction of the pair");
    trial.relative(name("slowing of the thigh"), "rad/s^2", dt, found.slowing, slowing, 0.02, "mu N R / I");
    trial.at_most(name("speed at the end"), "rad/s", dt, std::abs(found.end), 0.01, "the forearm holds it");
  }
}

}  // namespace duet::conformance
