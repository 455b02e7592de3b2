// The sledge on the ground and a human of one hand, in the engine of a test; skips the test where the engine is absent.
#pragma once

#include <cmath>

#include "duet/robots/dynamics.h"
#include "tests/backends/engine_names.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet::test {

inline constexpr double kMass = 10.0;  // of the sledge

// A human of one capsule, the left hand: joint 20 to joint 22.
inline HumanBody hand() {
  HumanBody human;
  HumanCapsule capsule;
  capsule.name = "left_hand";
  capsule.region = "hand";
  capsule.joint_a = 20;
  capsule.joint_b = 22;
  capsule.radius = 0.05;
  human.capsules = {capsule};
  return human;
}

// The hand across the way of the sledge's front spheres, `gap` before them.
inline HumanJoints hand_before_sledge(const RobotState& state, double gap) {
  HumanJoints joints = HumanJoints::Zero();
  const Eigen::Vector3d middle = state.X_WB.p + Eigen::Vector3d(0.2 + 0.02 + 0.05 + gap, 0.0, -0.08);
  joints.col(20) = middle + Eigen::Vector3d(0.0, 0.4, 0.0);
  joints.col(22) = middle - Eigen::Vector3d(0.0, 0.4, 0.0);
  return joints;
}

inline Eigen::Vector3d force_of(const Backend& backend, ContactSide side) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Contact& contact : backend.contacts())
    if (contact.side == side) sum += contact.f_W;
  return sum;
}

struct ContactScene : ::testing::Test {
  explicit ContactScene(std::string engine_name) : engine(std::move(engine_name)) {}
  void SetUp() override {
    if (!is_here(engine)) GTEST_SKIP() << "not run: engine " << engine << " absent";
    scene.robot = sledge();
    scene.human = hand();
    scene.partner = PartnerMode::kNone;
    rest = state_of(*scene.robot, {0.0, 0.0, 0.1});
  }
  void start(const RobotState& state) {
    backend = make_backend(engine, scene);
    backend->reset(state);
  }
  void run(double seconds) {
    const int steps = static_cast<int>(std::lround(seconds / scene.dt));
    for (int i = 0; i < steps; ++i) ASSERT_EQ(backend->step(no_torque(*scene.robot)), Outcome::kOk);
  }
  std::string engine;
  Scene scene;
  RobotState rest;
  std::unique_ptr<Backend> backend;
};

}  // namespace duet::test
