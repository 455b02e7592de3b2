// The tumbling box of Open Robotics' benchmark: flight of a single body.
#include <algorithm>

#include "duet/backends/conformance/scenes.h"
#include "duet/backends/conformance/small_robots.h"
#include "duet/backends/conformance/trial.h"

namespace duet::conformance {
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

}  // namespace duet::conformance
