// Rods that swing from a held base.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/backends/conformance/reference.h"
#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"

namespace duet::conformance {
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
