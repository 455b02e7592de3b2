// A test on one engine: skipped where the engine is not here; robots alone in it.
// test.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "tests/backends/engine_names.h"

namespace duet::test {

// `Test`: ::testing::Test, or TestWithParam where the engine is the parameter.
template <typename Test>
struct OnEngine : Test {
  explicit OnEngine(std::string name) : engine(std::move(name)) {}
  void SetUp() override {
    if (!is_here(engine)) GTEST_SKIP() << "not run: engine " << engine << " absent";
  }
  // The robot alone, without collisions of its own links.
  std::unique_ptr<Backend> make(std::shared_ptr<const RobotModel> robot, double dt = 0.002,
                                const Eigen::Vector3d& gravity = Scene().gravity) const {
    Scene scene;
    scene.robot = std::move(robot);
    scene.partner = PartnerMode::kNone;
    scene.dt = dt;
    scene.gravity = gravity;
    scene.self_collision = false;
    return make_backend(engine, scene);
  }
  const std::string engine;
};

}  // namespace duet::test
