// A controller on its own body in an engine: 2 ms physics, 50 Hz control.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/require.h"
#include "duet/rollout/world.h"
#include "tests/controllers/fake_network.h"

namespace duet::test {

struct WalkSetup {
  std::string controller = {};
  ControllerOptions options = {};
  std::string engine = "mujoco";
  EngineOptions engine_options = {};
  std::string card = {};                         // "": the controller's own
  std::shared_ptr<const RobotModel> robot = {};  // instead of the card's
  double seconds = 10.0;
  double friction = 0.8;
  Eigen::VectorXd start = {};  // joints; empty: the card's neutral pose with the arms as in `arms`
  std::function<Reference(int tick, const Reference& neutral)> reference = {};  // absent: the start's angles, standing
  std::function<void(int tick, Backend&)> act_on = {};                          // pushes; absent: nobody does
};

// The result of a run; means are over the time from 2 s on.
struct Walk {
  bool upright = true;
  double seconds = 0.0;
  double forward = 0.0, yaw_rate = 0.0, height = 0.0;  // mean forward speed in the heading, rate, pelvis height
  double drift = 0.0;                                  // of the root in the plane from its start [m]
  double joint_rms = 0.0;                              // of the angles at a tick to the reference's [rad]
  double root_rms = 0.0;                               // of the root's distance in the plane to the reference's [m]
  RobotState last;
};

inline bool stands(const RobotState& state) { return !has_fallen(state, {0.3, 0.5}); }

inline Walk walk(const WalkSetup& setup) {
  Scene scene;
  scene.robot = setup.robot != nullptr
                    ? setup.robot
                    : body(setup.card.empty() ? controller_info(setup.controller).robot : setup.card);
  scene.partner = PartnerMode::kNone;
  scene.friction.robot_ground = setup.friction;
  scene.options = setup.engine_options;
  const auto backend = make_backend(setup.engine, scene);
  const auto controller = make_controller(setup.controller, scene.robot, setup.options);
  RobotState state = scene.robot->standing_state();
  if (setup.start.size() > 0) state.q = setup.start;
  const Reference neutral{state.X_WB, state.q};
  backend->reset(state);
  controller->reset(state);
  JointCommand command;
  Walk result;
  int measured = 0, ticks = 0;
  double squares = 0.0, root_squares = 0.0;
  for (int tick = 0; tick < std::lround(setup.seconds * 50.0) && result.upright; ++tick, ++ticks) {
    const Reference reference = setup.reference ? setup.reference(tick, neutral) : neutral;
    const RobotState& now = backend->state();
    squares += (now.q - reference.q).squaredNorm() / static_cast<double>(now.q.size());
    root_squares += (now.X_WB.p - reference.X_WB.p).head<2>().squaredNorm();
    if (tick >= 100) {
      result.forward += (yaw_rotation(-yaw_of(now.X_WB.R)) * now.v_WB).x();
      result.yaw_rate += now.w_WB_B.z();
      result.height += now.X_WB.p.z();
      ++measured;
    }
    controller->act(now, reference, command);
    if (setup.act_on) setup.act_on(tick, *backend);
    const int steps = steps_per_tick(scene.dt), steps_per_act = steps / controller->acts_per_tick();
    const auto at_its_rate = [&](int i) -> const JointCommand& {
      if (i > 0 && i % steps_per_act == 0) controller->act(backend->state(), reference, command);
      return command;
    };
    const auto upright = [&](int) { return stands(backend->state()); };
    result.upright = step_control_period(*backend, steps, at_its_rate, upright) == Outcome::kOk;
  }
  for (double* mean : {&result.forward, &result.yaw_rate, &result.height}) *mean /= std::max(measured, 1);
  result.joint_rms = std::sqrt(squares / std::max(ticks, 1));
  result.root_rms = std::sqrt(root_squares / std::max(ticks, 1));
  result.seconds = backend->time();
  result.last = backend->state();
  result.drift = (result.last.X_WB.p - neutral.X_WB.p).head<2>().norm();
  return result;
}

// The card's neutral legs with every other joint at 0, as the measurements of published_cases.h start.
inline Eigen::VectorXd arms_down(const RobotModel& robot) {
  Eigen::VectorXd q = robot.neutral;
  q.tail(robot.dof() - 12).setZero();
  return q;
}

}  // namespace duet::test
