// The torque law of JointCommand at one joint, and in all joints of the G1 at their effort.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/backends/actuation.h"
#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/physics_backend.h"

namespace duet::conformance {
namespace {

constexpr double kInertia = kWheelInertia + kWheelArmature;
constexpr double kBaseGivesWay = 1e-6;  // relative: the wheel's inertia over the base's

void start_wheel(World& world) {
  world.reset(state_at(world.robot(), {0.0, 0.0, 50.0}));
  hold_base(world.backend());
}

// Velocity that one step from rest gives. [rad/s^2] as an acceleration.
double first_acceleration(World& world, const JointCommand& command) {
  start_wheel(world);
  world.step(command);
  return world.state().v[0] / world.dt();
}

struct Oscillator {
  double natural, damping, target;  // [rad/s], ratio, [rad]

  [[nodiscard]] double position(double t) const {
    const double decay = natural * damping, omega = natural * std::sqrt(1.0 - damping * damping);
    return target * (1.0 - std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t)));
  }
};

// Each joint towards the target 0.6 rad away, by turns in either direction.
JointCommand step_of_all_joints(const RobotModel& robot) {
  JointCommand command = robot.default_command(robot.neutral);
  for (int j = 0; j < robot.dof(); ++j) command.q_target[j] += j % 2 == 0 ? 0.6 : -0.6;
  return command;
}

// Our own law and dynamics by semi-implicit Euler, without contact.
RobotState integrate_law(const Scene& scene, RobotState state, const JointCommand& command, double seconds) {
  ImplicitLaw law(scene);
  const Eigen::VectorXd no_force = Eigen::VectorXd::Zero(6 + scene.robot->dof());
  const int steps = steps_in(seconds, scene.dt);
  for (int i = 0; i < steps; ++i) {
    if (!law.begin(state, command)) throw std::runtime_error("the integration of the law diverged");
    law.solve(no_force);
    const Eigen::VectorXd& a = law.acceleration();
    state.v_WB += scene.dt * a.head<3>();
    state.w_WB_B += scene.dt * a.segment<3>(3);
    state.v += scene.dt * a.tail(scene.robot->dof());
    state.X_WB.p += scene.dt * state.v_WB;
    const double angle = scene.dt * state.w_WB_B.norm();
    if (angle > 0.0) state.X_WB.R = state.X_WB.R * Eigen::AngleAxisd(angle, state.w_WB_B.normalized());
    state.X_WB.R.normalize();
    state.q += scene.dt * state.v;
  }
  return state;
}

}  // namespace

void measure_armature(Trial& trial) {
  World world(trial, trial.scene(wheel(), trial.dt()));
  JointCommand command = no_torque(world.robot());
  command.tau_ff[0] = 0.5;
  start_wheel(world);
  world.run(0.2, command);
  trial.relative("acceleration under 0.5 N m", "rad/s^2", trial.dt(), world.state().v[0] / world.time(), 0.5 / kInertia,
                 2.0 * kBaseGivesWay, "torque over inertia plus armature");
  trial.relative("reported torque", "N m", trial.dt(), world.backend().torques()[0], 0.5, 1e-9, "the feed-forward");
}

void measure_effort(Trial& trial) {
  World world(trial, trial.scene(wheel(), trial.dt()));
  const double limit = kWheelEffort / kInertia;
  JointCommand command = no_torque(world.robot());
  command.tau_ff[0] = 10.0 * kWheelEffort;
  trial.relative("acceleration under ten times the effort", "rad/s^2", trial.dt(), first_acceleration(world, command),
                 limit, 2.0 * kBaseGivesWay, "effort over inertia plus armature");
  trial.relative("reported torque at the limit", "N m", trial.dt(), world.backend().torques()[0], kWheelEffort, 1e-9,
                 "the effort");
  command.tau_ff[0] = 0.0;
  command.kp[0] = 1000.0;
  command.kd[0] = 1.0;
  command.q_target[0] = -1.0;
  trial.relative("acceleration under a stiff spring", "rad/s^2", trial.dt(), first_acceleration(world, command), -limit,
                 2.0 * kBaseGivesWay, "the limit holds for the PD part");
  command.kp[0] = 30.0;
  command.kd[0] = 0.0;
  command.q_target[0] = 0.5;
  command.tau_ff[0] = -10.0;
  const double stiffening = trial.dt() * trial.dt() * command.kp[0] / kInertia;
  trial.relative("acceleration under 15 - 10 N m", "rad/s^2", trial.dt(), first_acceleration(world, command),
                 5.0 / kInertia, 1.5 * stiffening + 2.0 * kBaseGivesWay,
                 "the sum is limited, not its parts; the implicit spring adds dt^2 kp to the inertia");
}

void measure_step_response(Trial& trial) {
  const Oscillator exact{.natural = 10.0, .damping = 0.25, .target = 0.2};
  std::vector<double> errors;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(wheel(), dt));
    JointCommand command = no_torque(world.robot());
    command.q_target[0] = exact.target;
    command.kp[0] = kInertia * exact.natural * exact.natural;
    command.kd[0] = 2.0 * kInertia * exact.natural * exact.damping;
    start_wheel(world);
    double error = 0.0;
    const int steps = steps_in(1.0, dt);
    for (int i = 0; i < steps; ++i) {
      world.step(command);
      error = std::max(error, std::abs(world.state().q[0] - exact.position(world.time())));
    }
    errors.push_back(error);
    trial.at_most("largest error in 1 s", "rad", dt, error, exact.target * exact.natural * dt,
                  "against the damped oscillator; target times natural frequency times dt");
    trial.dot("largest error of the step response", "rad", dt, error, world.cost());
  }
  trial.first_order("order of the error", trial.step_sizes(), errors);
}

void measure_saturation(Trial& trial) {
  const double seconds = 0.2;
  const auto robot = without_stops(*trial.robot());
  const RobotState start = state_at(*robot, {0.0, 0.0, 50.0});
  const JointCommand command = step_of_all_joints(*robot);
  const RobotState end = integrate_law(trial.scene(robot, 1e-4), start, command, seconds);
  std::vector<double> errors;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(robot, dt));
    world.reset(start);
    world.run(seconds, command);
    errors.push_back(largest_joint_error(world.state(), end));
    trial.at_most("joint error after 0.2 s", "rad", dt, errors.back(), 20.0 * dt,
                  "0.6 rad target step in all joints; our law at 0.1 ms. First order, 0.04 rad at 2 ms");
    trial.dot("joint error after 0.2 s at the effort limit", "rad", dt, errors.back(), world.cost());
  }
}

namespace {

// A push of twice the effort holds the joint at its stop against a drive of 6 N m. Without the stop its damping would
// ask for more than the effort in the first step: the limit counts for the torque that the joint bears.
void measure_push_into_stop(Trial& trial) {
  constexpr double kDrive = 6.0, kArm = 0.5;  // [N m], [m]
  World world(trial, trial.scene(wheel(), trial.dt()));
  RobotState start = state_at(world.robot(), {0.0, 0.0, 50.0});
  start.q[0] = world.robot().joints[0].lower;
  world.reset(start);
  hold_base(world.backend());
  world.backend().push(1, Eigen::Vector3d(0.0, -2.0 * kWheelEffort / kArm, 0.0),
                       start.X_WB.p + Eigen::Vector3d(kArm, 0.0, 0.0));
  JointCommand command = no_torque(world.robot());
  command.kd[0] = 100.0;
  command.tau_ff[0] = kDrive;
  world.run(0.1, command);
  trial.relative("torque against a push into the stop", "N m", trial.dt(), world.backend().torques()[0], kDrive, 0.05,
                 "at rest the drive, below the effort");
}

}  // namespace

void measure_joint_stop(Trial& trial) {
  World world(trial, trial.scene(wheel(), trial.dt()));
  JointCommand command = no_torque(world.robot());
  command.tau_ff[0] = kWheelEffort;
  start_wheel(world);
  double highest = 0.0;
  const int steps = steps_in(2.0, trial.dt());
  for (int i = 0; i < steps; ++i) {
    world.step(command);
    highest = std::max(highest, world.state().q[0]);
  }
  const double stop = world.robot().joints[0].upper;
  trial.at_most("overshoot", "rad", trial.dt(), std::max(0.0, highest - stop), 0.1,
                "10 N m into the stop, which it meets at 16 rad/s: three steps of travel at 2 ms");
  trial.absolute("violation at rest", "rad", trial.dt(), world.state().q[0] - stop, 0.0, 0.01, "under 10 N m");
  trial.absolute("velocity at rest", "rad/s", trial.dt(), world.state().v[0], 0.0, 1e-2, "2 s after the start");
  measure_push_into_stop(trial);
}

// The closed forms of both laws at the wheel.

namespace {

// One joint of that inertia under PD, step by step: what an engine does at one joint, exactly.
struct DiscreteJoint {
  TorqueLaw law;
  double inertia, dt;
  double q = 0.0, v = 0.0;  // [rad], [rad/s]

  [[nodiscard]] double acceleration(double kp, double kd, double target) const {
    const double torque = kp * (target - q) - kd * v;
    if (law == TorqueLaw::kExplicit) return std::clamp(torque, -kWheelEffort, kWheelEffort) / inertia;
    return (torque - dt * kp * v) / (inertia + dt * kd + dt * dt * kp);
  }
  void step(double kp, double kd, double target) {
    v += dt * acceleration(kp, kd, target);
    q += dt * v;
  }
};

struct DrivenWheel {
  TorqueLaw law;
  double armature;  // share

  [[nodiscard]] std::string name(const std::string& quantity) const {
    return fmt::format("{} ({}, armature {:g})", quantity, torque_law_names()[static_cast<std::size_t>(law)], armature);
  }
  [[nodiscard]] DiscreteJoint joint(double dt) const {
    return {.law = law, .inertia = kWheelInertia + armature * kWheelArmature, .dt = dt};
  }
  [[nodiscard]] Scene scene(const Trial& trial, double dt) const {
    Scene scene = trial.scene(wheel(), dt);
    scene.robot = with_armature(wheel(), armature);
    scene.law = law;
    return scene;
  }
};

// A second of the step response of kp = 100 I, kd = 5 I against the law's own recursion.
void measure_recursion(Trial& trial, const DrivenWheel& driven, double dt) {
  constexpr double kTarget = 0.2, kSeconds = 1.0, kNatural = 10.0;
  World world(trial, driven.scene(trial, dt));
  DiscreteJoint exact = driven.joint(dt);
  JointCommand command = no_torque(world.robot());
  command.q_target[0] = kTarget;
  command.kp[0] = kNatural * kNatural * exact.inertia;
  command.kd[0] = 0.5 * kNatural * exact.inertia;
  start_wheel(world);
  trial.relative(driven.name("first acceleration"), "rad/s^2", dt, first_acceleration(world, command),
                 exact.acceleration(command.kp[0], command.kd[0], kTarget), 2.0 * kBaseGivesWay, "of the law");
  start_wheel(world);
  double error = 0.0;
  for (int i = 0; i < steps_in(kSeconds, dt); ++i) {
    world.step(command);
    exact.step(command.kp[0], command.kd[0], kTarget);
    error = std::max(error, std::abs(world.state().q[0] - exact.q));
  }
  trial.at_most(driven.name("largest error in 1 s"), "rad", dt, error, kTarget * kNatural * kSeconds * kBaseGivesWay,
                "against the law's recursion; phase that the base's giving way costs");
}

// Ten steps of damping alone, dt kd = `ratio` I. By the explicit law the speed is multiplied by 1 - ratio in each step,
// which grows above 2; by the implicit one it is divided by 1 + ratio.
void measure_damping(Trial& trial, const DrivenWheel& driven, double dt, double ratio) {
  constexpr int kSteps = 10;
  constexpr double kSpeed = 0.01;  // [rad/s]: below the effort, also after 10 growing steps
  World world(trial, driven.scene(trial, dt));
  const DiscreteJoint joint = driven.joint(dt);
  JointCommand command = no_torque(world.robot());
  command.kd[0] = ratio * joint.inertia / dt;
  RobotState start = state_at(world.robot(), {0.0, 0.0, 50.0});
  start.v[0] = kSpeed;
  world.reset(start);
  hold_base(world.backend());
  for (int i = 0; i < kSteps; ++i) world.step(command);
  const double kept = driven.law == TorqueLaw::kExplicit ? 1.0 - ratio : 1.0 / (1.0 + ratio);
  trial.relative(driven.name(fmt::format("speed kept by ten steps at dt kd = {:g} I", ratio)), "", dt,
                 world.state().v[0] / kSpeed, std::pow(kept, kSteps), 4.0 * kSteps * kBaseGivesWay,
                 driven.law == TorqueLaw::kExplicit ? "(1 - ratio)^10: stable below 2, and above it grows"
                                                    : "(1 + ratio)^-10: stable at any step");
}

}  // namespace

void measure_law(Trial& trial) {
  for (const TorqueLaw law : {TorqueLaw::kImplicit, TorqueLaw::kExplicit})
    for (const double armature : {1.0, 0.0}) {
      const DrivenWheel driven{law, armature};
      for (const double dt : trial.step_sizes()) measure_recursion(trial, driven, dt);
      for (const double ratio : {1.9, 2.1}) measure_damping(trial, driven, trial.dt(), ratio);
    }
  const DrivenWheel driven{TorqueLaw::kExplicit, 1.0};
  World world(trial, driven.scene(trial, trial.dt()));
  JointCommand command = no_torque(world.robot());
  command.kp[0] = 1000.0;
  command.q_target[0] = -1.0;
  command.tau_ff[0] = 2.0 * kWheelEffort;
  trial.relative(driven.name("acceleration under a stiff spring"), "rad/s^2", trial.dt(),
                 first_acceleration(world, command), -kWheelEffort / kInertia, 2.0 * kBaseGivesWay,
                 "the effort limits the sum of PD and feed-forward");
  trial.relative(driven.name("reported torque at the limit"), "N m", trial.dt(), world.backend().torques()[0],
                 -kWheelEffort, 1e-9, "the effort");
}

// Rods that swing from a held base.

namespace {

constexpr double kPivotHeight = 5.0;  // [m]

RobotState hanging(const RobotModel& robot) { return state_at(robot, {0.0, 0.0, kPivotHeight}); }

// 4 K(sin(amplitude / 2)) / omega of the compound pendulum.
double pendulum_period(double amplitude) {
  const double about_pivot = kRodInertia + 0.25 * kRodMass * kRodLength * kRodLength;
  const double omega = std::sqrt(0.5 * kRodMass * kGravity * kRodLength / about_pivot);
  return 4.0 * std::comp_ellint_1(std::sin(0.5 * amplitude)) / omega;
}

struct Swing {
  double period = 0.0, highest_energy_error = 0.0;
};

// Mean period over whole swings, by the passages through zero in one direction.
Swing swing(World& world, double amplitude, double seconds) {
  RobotState start = hanging(world.robot());
  start.q[0] = amplitude;
  world.reset(start);
  hold_base(world.backend());
  const JointCommand command = no_torque(world.robot());
  const double rest = energy_above_base(world.robot(), hanging(world.robot()), kGravity);
  const double energy = energy_above_base(world.robot(), start, kGravity) - rest;
  std::vector<double> passages;
  Swing found;
  double previous = amplitude;
  const int steps = steps_in(seconds, world.dt());
  for (int i = 0; i < steps; ++i) {
    world.step(command);
    const double q = world.state().q[0];
    if (previous > 0.0 && q <= 0.0) passages.push_back(world.time() - world.dt() * q / (q - previous));
    previous = q;
    const double now = energy_above_base(world.robot(), world.state(), kGravity) - rest;
    found.highest_energy_error = std::max(found.highest_energy_error, std::abs(now - energy) / energy);
  }
  if (passages.size() > 1)
    found.period = (passages.back() - passages.front()) / static_cast<double>(passages.size() - 1);
  return found;
}

}  // namespace

void measure_pendulum(Trial& trial) {
  const double amplitude = 0.5 * std::numbers::pi;
  const double period = pendulum_period(amplitude);
  const double seconds = trial.full() ? 60.0 : 10.0;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(rods(1), dt));
    const Swing found = swing(world, amplitude, seconds);
    trial.relative("period", "s", dt, found.period, period, 0.1 * dt,
                   "complete elliptic integral; semi-implicit Euler keeps it to second order");
    trial.at_most("largest error of the energy, relative", "", dt, found.highest_energy_error, 10.0 * dt,
                  "semi-implicit Euler swings about the energy to first order and does not drift");
    trial.dot("largest error of the energy, relative", "", dt, found.highest_energy_error, world.cost());
  }
}

void measure_chain(Trial& trial) {
  const auto robot = rods(2);
  RobotState start = hanging(*robot);
  start.q << 1.5, 0.8;
  Eigen::VectorXd Q = Eigen::VectorXd::Zero(8);
  Q[2] = kBaseMass * kGravity;
  const double seconds = 1.0;
  const RobotState end = integrate(*robot, {0.0, 0.0, -kGravity}, start, Q, seconds, 1e-4);
  std::vector<double> errors;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(robot, dt));
    world.reset(start);
    hold_base(world.backend());
    world.run(seconds, no_torque(*robot));
    errors.push_back(largest_joint_error(world.state(), end));
    trial.at_most("joint error after 1 s", "rad", dt, errors.back(), 15.0 * dt,
                  "against Runge-Kutta at 0.1 ms; first order");
    trial.dot("joint error after 1 s", "rad", dt, errors.back(), world.cost());
  }
  trial.first_order("order of the joint error", trial.step_sizes(), errors);
}

}  // namespace duet::conformance
