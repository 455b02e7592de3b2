// A limiter of the G1's arms with nobody near, or with an adult, for the tests of the safety envelope.
#pragma once

#include "duet/hardware/safety/limiter.h"

namespace duet::test {

inline const std::shared_ptr<const RobotModel>& g1() {
  static const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  return robot;
}

// The lengths of an adult's bones [m].
inline HumanBody adult_body() {
  std::array<double, 24> lengths;
  lengths.fill(0.12);
  for (const int leg : {4, 5, 7, 8}) lengths[leg] = 0.41;
  for (const int arm : {18, 19, 20, 21}) lengths[arm] = 0.26;
  return make_human_body(lengths);
}

// Arms and waist yaw excepted: what the arm topic of a walking robot moves.
inline ExecutedJoints arms_of(const RobotModel& robot) {
  ExecutedJoints executed;
  for (const auto& arm : robot.roles.arms) executed.joints.insert(executed.joints.end(), arm.begin(), arm.end());
  executed.kp.setConstant(robot.dof(), 60.0);
  executed.kd.setConstant(robot.dof(), 1.5);
  return executed;
}

inline LimiterSetup nobody_near() {
  LimiterSetup setup;
  setup.robot = g1();
  setup.executed = arms_of(*g1());
  setup.dt = 0.02;
  setup.person = false;
  return setup;
}

inline LimiterSetup beside_an_adult() {
  LimiterSetup setup = nobody_near();
  setup.person = true;
  setup.human = adult_body();
  setup.contact_limits = load_contact_limits(default_contact_limits_path());
  return setup;
}

// Standing upright with arms hanging, the pelvis at `p_W` [m]; close to SMPL's proportions.
inline HumanJoints standing_adult(const Eigen::Vector3d& p_W) {
  HumanJoints joints;
  joints << Eigen::Matrix<double, 3, 24>::Zero();
  const double heights[24] = {0.0,  -0.08, -0.08, 0.11, -0.48, -0.48, 0.25, -0.89, -0.89, 0.31,  -0.95, -0.95,
                              0.52, 0.43,  0.43,  0.6,  0.45,  0.45,  0.19, 0.19,  -0.06, -0.06, -0.14, -0.14};
  const double sides[24] = {0.0, 0.09, -0.09, 0.0, 0.09, -0.09, 0.0,  0.09,  -0.09, 0.0,   0.09, -0.09,
                            0.0, 0.07, -0.07, 0.0, 0.18, -0.18, 0.22, -0.22, 0.24,  -0.24, 0.24, -0.24};
  for (int j = 0; j < 24; ++j) joints.col(j) = p_W + Eigen::Vector3d(0.0, sides[j], heights[j]);
  return joints;
}

// A robot that stands where the limiter's outputs say: each tick it is where it was told to be.
struct LimitedRobot {
  explicit LimitedRobot(const LimiterSetup& setup) : limiter(setup) {
    input.state = g1()->standing_state();
    input.odometry = true;
    input.share = 1.0;
    state = limiter.start(input.state);
    command.q = input.state.q;
    command.root.height = setup.limits.height;
  }
  // One tick; `command` is sent anew with the next stamp.
  const LimitedCommand& tick() {
    command.stamp += limiter.setup().dt;
    limiter.tick(&command, input, state, out, counts);
    return out;
  }
  // The same, and the arms have arrived.
  const LimitedCommand& move() {
    tick();
    input.state.q = out.q;
    return out;
  }
  [[nodiscard]] long counted(ClampReason reason) const { return duet::counted(counts, reason); }

  Limiter limiter;
  LimiterInput input;
  MotionCommand command;
  LimiterState state;
  LimitedCommand out;
  ClampCounts counts{};
};

}  // namespace duet::test
