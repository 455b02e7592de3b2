// The robot in the air: the order of the integrator, and momentum.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/trial.h"
#include "duet/backends/narrow_phase.h"

namespace duet::conformance {
namespace {

constexpr double kFlight = 0.2;          // [s]
constexpr double kReferenceStep = 1e-4;  // of Runge-Kutta: its own error is far below 1e-8

struct Flight {
  RobotState start, end;
};

std::vector<Flight> reference_flights(const RobotModel& robot) {
  Random random(3, 3);
  std::vector<Flight> flights(3);
  const Eigen::VectorXd no_force = Eigen::VectorXd::Zero(6 + robot.dof());
  for (Flight& flight : flights) {
    flight.start = random_state(robot, {0.0, 0.0, 50.0}, 0.1, 1.0, random);
    flight.end = integrate(robot, {0.0, 0.0, -kGravity}, flight.start, no_force, kFlight, kReferenceStep);
  }
  return flights;
}

JointCommand thrash(const RobotModel& robot, double time) {
  JointCommand command = robot.default_command(robot.neutral);
  for (int j = 0; j < robot.dof(); ++j) command.q_target[j] += 0.3 * std::sin(2.0 * std::numbers::pi * 1.5 * time + j);
  return command;
}

// A value that should be zero is of first order in dt. Its size is known for the robot that stands in; on another robot
// it has to shrink with the step: to 0.5 of what it was, and 0.1 more.
void note_momentum(Trial& trial, const char* quantity, const char* unit, double dt, double value, double per_second,
                   double& before) {
  const double shrunk = 0.6 * std::exchange(before, value);
  if (trial.of_stand_in())
    trial.at_most(quantity, unit, dt, value, per_second * dt, "largest; it was zero. First order in dt");
  else if (shrunk > 0.0)
    trial.at_most(quantity, unit, dt, value, shrunk, "largest; at most 0.6 of that with twice the step");
}

}  // namespace

void measure_free_flight(Trial& trial) {
  const auto robot = without_stops(*trial.robot());
  const std::vector<Flight> flights = reference_flights(*robot);
  std::vector<double> errors;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(robot, dt));
    double error = 0.0;
    for (const Flight& flight : flights) {
      world.reset(flight.start);
      world.run(kFlight, no_torque(*robot));
      error = std::max(error, largest_joint_error(world.state(), flight.end));
    }
    errors.push_back(error);
    trial.at_most("joint error after 0.2 s", "rad", dt, error, 5.0 * dt,
                  "largest of 3 random flights against Runge-Kutta at 0.1 ms; 0.01 rad at 2 ms, first order");
    trial.dot("joint error after 0.2 s of flight", "rad", dt, error, world.cost());
  }
  trial.first_order("order of the joint error", trial.step_sizes(), errors);
}

void measure_momentum(Trial& trial) {
  const double seconds = trial.full() ? 3.0 : 1.0;
  double linear_before = 0.0, angular_before = 0.0;
  for (const double dt : trial.step_sizes()) {
    Scene scene = trial.scene(trial.robot(), dt);
    scene.gravity.setZero();
    World world(trial, scene);
    world.reset(state_at(world.robot(), {0.0, 0.0, 50.0}));
    double linear = 0.0, angular = 0.0;
    const int steps = steps_in(seconds, dt), every = steps_in(0.02, dt);
    for (int i = 0; i < steps; ++i) {
      world.step(thrash(world.robot(), world.time()));
      if ((i + 1) % every != 0) continue;
      const Momentum momentum = momentum_of(world.robot(), world.state());
      linear = std::max(linear, momentum.linear.norm());
      angular = std::max(angular, momentum.angular.norm());
    }
    note_momentum(trial, "linear momentum", "N s", dt, linear, 150.0, linear_before);
    note_momentum(trial, "angular momentum", "N m s", dt, angular, 100.0, angular_before);
    trial.dot("largest angular momentum made from nothing", "N m s", dt, angular, world.cost());
  }
}

// The tumbling box of Open Robotics' benchmark: flight of a single body.

namespace {

constexpr double kDropHeight = 1000.0;  // it falls 490 m in 10 s
constexpr double kLinear = 1e-7;        // rounding of 2e4 steps on numbers of 1000 m

struct Throw {
  Eigen::Vector3d v_W, w_B;
  double drift;  // of energy and angular momentum allowed, relative, per second of step size
  bool tumbles;  // so that there is a drift
};

void measure_box(Trial& trial, const Throw& thrown) {
  const auto robot = tumbling_box();
  const Eigen::Matrix3d inertia = robot->links[0].inertia;
  const double seconds = 10.0;
  std::vector<double> drifts;
  for (const double dt : trial.step_sizes()) {
    World world(trial, trial.scene(robot, dt));
    RobotState start = state_at(*robot, {0.0, 0.0, kDropHeight});
    start.v_WB = thrown.v_W;
    start.w_WB_B = thrown.w_B;
    world.reset(start);
    const JointCommand command = no_torque(*robot);
    const Eigen::Vector3d L0 = inertia * thrown.w_B;
    const double E0 = 0.5 * thrown.w_B.dot(L0);
    const Eigen::Vector3d gravity = world.backend().scene().gravity;
    double velocity = 0.0, position = 0.0, energy = 0.0, momentum = 0.0;
    const int steps = steps_in(seconds, dt);
    for (int i = 0; i < steps; ++i) {
      world.step(command);
      const RobotState& state = world.state();
      const double t = world.time();
      const Eigen::Vector3d L = state.X_WB.R * (inertia * state.w_WB_B);
      velocity = std::max(velocity, (state.v_WB - (thrown.v_W + t * gravity)).norm());
      position =
          std::max(position, (state.X_WB.p - (start.X_WB.p + t * thrown.v_W + 0.5 * t * (t + dt) * gravity)).norm());
      energy = std::max(energy, std::abs(0.5 * state.w_WB_B.dot(inertia * state.w_WB_B) - E0) / E0);
      momentum = std::max(momentum, (L - L0).norm() / L0.norm());
    }
    trial.at_most("velocity against v0 + g t", "m/s", dt, velocity, kLinear, "largest over 10 s");
    trial.at_most("position against semi-implicit Euler", "m", dt, position, kLinear,
                  "largest over 10 s; p0 + v0 t + g t (t + dt) / 2");
    trial.at_most("drift of the rotational energy, relative", "", dt, energy, thrown.drift * dt,
                  "largest over 10 s; first order in dt");
    trial.at_most("drift of the angular momentum, relative", "", dt, momentum, thrown.drift * dt,
                  "largest over 10 s; first order in dt");
    trial.dot("drift of the angular momentum over 10 s, relative", "", dt, momentum, world.cost());
    drifts.push_back(momentum);
  }
  if (thrown.tumbles) trial.first_order("order of the drift of the angular momentum", trial.step_sizes(), drifts);
}

}  // namespace

void measure_box_simple(Trial& trial) {
  measure_box(trial, {.v_W = {-0.9, 0.4, 0.1}, .w_B = {0.5, 0.0, 0.0}, .drift = 1e-6, .tumbles = false});
}

void measure_box_complex(Trial& trial) {
  measure_box(trial, {.v_W = {-2.0, 2.0, 8.0}, .w_B = {0.1, 5.0, 0.1}, .drift = 60.0, .tumbles = true});
}

// Scenes that check what the engine makes of a state: kinematics and instantaneous accelerations.

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
