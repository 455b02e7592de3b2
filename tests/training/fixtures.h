// Fixtures that the tests of training share: the robot, and whether its simulator is here.
#pragma once

#include <memory>

#include "duet/robots/robot_model.h"
#include "tests/backends/engine_names.h"

namespace duet::test {

inline std::shared_ptr<const RobotModel> g1() {
  static const auto robot = load_shared_robot();
  return robot;
}

// A test of the training: skipped where MuJoCo is absent.
class InMujoco : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!is_here("mujoco")) GTEST_SKIP() << "not run: engine mujoco absent";
  }
};

}  // namespace duet::test
