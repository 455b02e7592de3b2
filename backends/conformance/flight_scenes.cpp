// The robot in the air: the order of the integrator, and momentum.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"

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

}  // namespace duet::conformance
