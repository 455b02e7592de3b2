// Simbody: stiff servos, ways back from beyond a stop, options, standing at three steps. Laws of every engine are
// in engine_*_test.cpp.
#include <cmath>

#include "duet/backends/engine_module.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Simbody : test::OnEngine<::testing::Test> {
  Simbody() : OnEngine("simbody") {}
};

struct SimbodyWheel : Simbody {
  void SetUp() override {
    Simbody::SetUp();
    if (IsSkipped()) return;
    backend = make(test::wheel());
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command = test::no_torque(*backend->scene().robot);
  }
  static constexpr double kInertia = test::kWheelInertia + test::kWheelArmature;
  std::unique_ptr<Backend> backend;
  JointCommand command;
};

TEST_F(SimbodyWheel, GainsMayChangeAtEveryStep) {
  double q = 0.0, v = 0.0;
  const double dt = backend->scene().dt;
  for (int i = 0; i < 100; ++i) {
    const double kp = 1.0 + i % 7, kd = 0.1 * (i % 3);
    command.kp[0] = kp;
    command.kd[0] = kd;
    command.q_target[0] = 0.1;
    backend->step(command);
    v = (kInertia * v + dt * kp * (0.1 - q)) / (kInertia + dt * kd + dt * dt * kp);
    q += dt * v;
    ASSERT_NEAR(backend->state().q[0], q, 1e-6);
  }
}

TEST_F(Simbody, AStiffServoIsStable) {
  const auto robot = test::wheel();
  robot->joints[0].effort = 1e9;
  const auto backend = make(robot);
  backend->reset(test::state_of(*robot, {0.0, 0.0, 1000.0}));
  JointCommand command = test::no_torque(*robot);
  command.q_target[0] = 0.5;
  command.kp[0] = 1e6;
  command.kd[0] = 1e3;
  for (int i = 0; i < 100; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_NEAR(backend->state().q[0], 0.5, 1e-4);
  EXPECT_NEAR(backend->state().v[0], 0.0, 1e-4);
}

TEST_F(SimbodyWheel, ComesBackFromBeyondAStop) {
  RobotState state = test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0});
  state.q[0] = 1.1;
  backend->reset(state);
  for (int i = 0; i < 100; ++i) backend->step(command);
  EXPECT_LT(backend->state().q[0], 1.0 + 1e-6);
}

TEST_F(Simbody, OptionsAreCheckedByNameAndRange) {
  Scene scene;
  scene.robot = test::sledge();
  scene.options = {{"sweps", "10"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("simbody", scene); }).find("sweeps"),
            std::string::npos);
  scene.options = {{"sweeps", "0"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] {
              make_backend("simbody", scene);
            }).find("engine 'simbody': option 'sweeps': expected a whole number, 1 to 10000, found 0"),
            std::string::npos);
  scene.options = {{"contact_stiffness", "soft"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("simbody", scene); }).find("'soft'"),
            std::string::npos);
  scene.options = {{"contact_stiffness", "5e5"}, {"contact_damping", "0"}, {"stop_erp", "0.5"}, {"sweeps", "5"}};
  EXPECT_EQ(make_backend("simbody", scene)->name(), "simbody");
}

TEST_F(Simbody, SaysItsVersion) { EXPECT_EQ(make(test::sledge())->version().substr(0, 2), "3."); }

TEST_F(Simbody, PrintsNothing) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  {
    const auto backend = make(test::wheel());
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    backend->step(test::no_torque(*backend->scene().robot));
  }
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST_F(Simbody, BareLoopTakesTimeAndRefusesNoSteps) {
  Scene scene;
  scene.robot = test::sledge();
  const RobotState state = test::state_of(*scene.robot, {0.0, 0.0, 0.1});
  const auto& bare = engine_module("simbody").bare_step_seconds;
  EXPECT_GT(bare(scene, state, test::no_torque(*scene.robot), 10), 0.0);
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] {
              bare(scene, state, test::no_torque(*scene.robot), 0);
            }).find("steps is 0"),
            std::string::npos);
}

TEST_F(Simbody, TheLimitHoldsForTheG1UnderATargetFarAway) {
  const auto backend = make(test::g1());
  const RobotModel& robot = *backend->scene().robot;
  backend->reset(test::state_of(robot, {0.0, 0.0, 50.0}));
  JointCommand command = robot.default_command(robot.neutral.array() + 0.6);
  bool limited = false;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    for (int k = 0; k < robot.dof(); ++k) {
      ASSERT_LE(std::abs(backend->torques()[k]), 1.001 * robot.joints[k].effort) << robot.joints[k].name;
      limited = limited || std::abs(backend->torques()[k]) == robot.joints[k].effort;
    }
  }
  EXPECT_TRUE(limited);
}

// The centre of mass kept over the feet through the ankles, at 100 Hz.
void balance(const Backend& backend, Kinematics& kinematics, Eigen::Vector2d& before, JointCommand& command) {
  const RobotModel& robot = *backend.scene().robot;
  kinematics.update(backend.state().X_WB, backend.state().q);
  Eigen::Vector3d feet = Eigen::Vector3d::Zero();
  for (const int shape : robot.feet) feet += kinematics.shape_position(shape) / static_cast<double>(robot.feet.size());
  const Eigen::Vector2d lean = (kinematics.center_of_mass() - feet).head<2>() / 0.65;
  const Eigen::Vector2d by = (1.5 * lean + 0.35 * (lean - before) / 0.01).cwiseMax(-0.3).cwiseMin(0.3);
  before = lean;
  for (const int ankle : {4, 10}) {
    command.q_target[ankle] = robot.neutral[ankle] + by.x();
    command.q_target[ankle + 1] = robot.neutral[ankle + 1] - 0.5 * by.y();
  }
}

TEST_F(Simbody, TheG1StandsForTwoSecondsAndCarriesItsWeight) {
  for (const double dt : {0.0005, 0.002, 0.004}) {
    const auto backend = make(test::g1(), dt);
    const RobotModel& robot = *backend->scene().robot;
    backend->reset(robot.standing_state());
    JointCommand command = robot.default_command(robot.neutral);
    for (const int leg : {0, 6})
      for (int k = 0; k < 6; ++k) {
        command.kp[leg + k] = k < 4 ? 200.0 : 150.0;
        command.kd[leg + k] = 5.0;
      }
    Kinematics kinematics(robot);
    Eigen::Vector2d before = Eigen::Vector2d::Zero();
    const int steps = static_cast<int>(std::lround(3.0 / dt)), control = static_cast<int>(std::lround(0.01 / dt));
    double carried = 0.0, deepest = 0.0;
    for (int i = 0; i < steps; ++i) {
      if (i % std::max(1, control) == 0) balance(*backend, kinematics, before, command);
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      if (i < steps * 2 / 3) continue;
      for (const Contact& contact : backend->contacts()) {
        carried += contact.f_W.z() / (steps / 3.0);
        deepest = std::max(deepest, contact.depth);
      }
    }
    const double weight = robot.total_mass() * kGravity;
    EXPECT_NEAR(backend->state().X_WB.p.z(), robot.standing_height, 0.03) << dt;
    EXPECT_NEAR(carried, weight, 1e-3 * weight) << dt;
    EXPECT_LT(deepest, 1e-3) << dt;
  }
}

}  // namespace
}  // namespace duet
