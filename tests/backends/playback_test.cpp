#include <Eigen/Geometry>
#include <numbers>

#include "backends/factory.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr int kStepsPerFollow = 10;

struct Playback : ::testing::Test {
  Playback() {
    Scene scene;
    scene.robot = test::wheel();
    backend = make_backend("playback", scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 1.0}));
    command = test::no_torque(*scene.robot);
  }
  void run(int steps) {
    for (int i = 0; i < steps; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  }
  static Reference reference(double x, double yaw, double q) {
    return {{yaw_rotation(yaw), {x, -x, 1.0}}, Eigen::VectorXd::Constant(1, q)};
  }
  std::unique_ptr<Backend> backend;
  JointCommand command;
};

TEST_F(Playback, StaysUntilItFollows) {
  const RobotState before = backend->state();
  run(5);
  EXPECT_TRUE(test::same(backend->state(), before));
}

TEST_F(Playback, IsExactlyAtTheReferenceFromTheNextStepOn) {
  const Reference target = reference(0.3, 0.4, -0.7);
  backend->follow(target);
  EXPECT_EQ(backend->state().X_WB.p.x(), 0.0);
  for (int i = 0; i < kStepsPerFollow; ++i) {
    run(1);
    EXPECT_EQ(backend->state().X_WB.p, target.X_WB.p);
    EXPECT_EQ(backend->state().X_WB.R.coeffs(), target.X_WB.R.coeffs());
    EXPECT_EQ(backend->state().q, target.q);
  }
  EXPECT_EQ(backend->torques(), Eigen::VectorXd::Zero(1));
  EXPECT_TRUE(backend->contacts().empty());
}

TEST_F(Playback, VelocitiesAreDifferencesBetweenFollows) {
  backend->follow(reference(0.3, 3.1, -0.7));
  run(kStepsPerFollow);
  EXPECT_EQ(backend->state().v_WB, Eigen::Vector3d::Zero());
  backend->follow(reference(0.31, -3.1, -0.6));  // over the seam of yaw: the short way round
  run(kStepsPerFollow);
  const double seconds = kStepsPerFollow * backend->scene().dt;
  EXPECT_NEAR(backend->state().v_WB.x(), 0.01 / seconds, 1e-12);
  EXPECT_NEAR(backend->state().v_WB.y(), -0.01 / seconds, 1e-12);
  EXPECT_NEAR(backend->state().v[0], 0.1 / seconds, 1e-12);
  const double turn = 2.0 * (std::numbers::pi - 3.1);
  EXPECT_NEAR(backend->state().w_WB_B.z(), turn / seconds, 1e-9);
}

TEST_F(Playback, ContinuesBitwiseFromASnapshotWithAReferenceWaiting) {
  backend->follow(reference(0.1, 0.0, 0.1));
  run(4);
  backend->follow(reference(0.2, 0.1, 0.2));
  const Snapshot snapshot = backend->snapshot();
  run(3);
  const RobotState after = backend->state();
  backend->reset(test::state_of(*backend->scene().robot, {5.0, 0.0, 1.0}));
  backend->restore(snapshot);
  run(3);
  EXPECT_TRUE(test::same(backend->state(), after));
  EXPECT_EQ(backend->time(), 7 * backend->scene().dt);
}

TEST_F(Playback, PushesHaveNoEffect) {
  const RobotState before = backend->state();
  backend->push(0, {100.0, 0.0, 0.0}, {0.0, 0.0, 1.0});
  run(2);
  EXPECT_TRUE(test::same(backend->state(), before));
}

}  // namespace
}  // namespace duet
