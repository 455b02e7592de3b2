#include <gtest/gtest.h>

#include "duet/controllers/wbc_sim/observation.h"
#include "duet/core/numbers.h"
#include "duet/training/wbc_task.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using test::g1;

// The whole situation mirrored at the xz plane.
RobotState mirrored(const RobotState& state) {
  const Mirror joints = mirror_joints(*g1());
  RobotState other = state;
  const Eigen::Matrix3d M = Eigen::Vector3d(1, -1, 1).asDiagonal();
  other.X_WB.p = M * state.X_WB.p;
  other.X_WB.R = Eigen::Quaterniond(Eigen::Matrix3d(M * state.X_WB.R.toRotationMatrix() * M));
  other.v_WB = M * state.v_WB;
  other.w_WB_B = -(M * state.w_WB_B);
  for (int i = 0; i < g1()->dof(); ++i) {
    other.q[i] = static_cast<double>(joints.sign[i]) * state.q[joints.from[i]];
    other.v[i] = static_cast<double>(joints.sign[i]) * state.v[joints.from[i]];
  }
  return other;
}

RobotState some_state() {
  Random random(4, 4);
  RobotState state = g1()->standing_state();
  state.X_WB.p += Eigen::Vector3d(0.1, 0.2, -0.02);
  state.X_WB.R = yaw_rotation(0.3) * Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 0).normalized());
  for (int i = 0; i < 3; ++i) {
    state.v_WB[i] = random.normal();
    state.w_WB_B[i] = random.normal();
  }
  for (int i = 0; i < g1()->dof(); ++i) {
    state.q[i] += 0.1 * random.normal();
    state.v[i] = random.normal();
  }
  return state;
}

TEST(Mirror, TwiceIsTheIdentity) {
  for (const Mirror& mirror : {mirror_joints(*g1()), mirror_actor(*g1()), mirror_critic(*g1(), g1()->roles.bodies)}) {
    std::vector<float> x(mirror.size()), once(mirror.size()), twice(mirror.size());
    for (size_t i = 0; i < x.size(); ++i) x[i] = static_cast<float>(i) + 0.5F;
    mirror.apply(x, once);
    mirror.apply(once, twice);
    EXPECT_EQ(x, twice);
    EXPECT_NE(x, once);
  }
}

// The observation of the mirrored situation is the mirrored observation: computed from states, not from the table.
TEST(Mirror, ObservationsOfMirroredStatesAreMirroredObservations) {
  const RobotState state = some_state(), other = mirrored(state);
  RobotState reference_state = some_state();
  reference_state.X_WB.p = {0.0, -0.1, 0.74};
  reference_state.X_WB.R = yaw_rotation(-0.2) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  const RobotState other_reference = mirrored(reference_state);
  const std::vector<int> links = g1()->roles.bodies;
  const Mirror mirror = mirror_critic(*g1(), links);
  const auto observe = [&](const RobotState& robot, const RobotState& wanted) {
    WbcTracker tracker(g1());
    tracker.reset({wanted.X_WB, wanted.q});
    WbcSensors sensors;
    read_sensors(robot, tracker, sensors);
    Kinematics kinematics(*g1());
    kinematics.update(robot.X_WB, robot.q);
    std::vector<float> o(361);
    write_oracle(sensors, Eigen::VectorXf::Zero(29), {o.data(), 163});
    write_bodies(kinematics, tracker.root(), links, {o.data() + 163, 198});
    return o;
  };
  std::vector<float> expected(361);
  mirror.apply(observe(state, reference_state), expected);
  const std::vector<float> found = observe(other, other_reference);
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 2e-3) << i;
}

}  // namespace
}  // namespace duet
