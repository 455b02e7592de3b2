// Bullet: drift of a free box, stops of wrists, thrashing, options. Laws of every engine are in engine_*_test.cpp.
#include <cmath>

#include "duet/backends/engine_module.h"
#include "tests/backends/contact_scene.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Bullet : test::OnEngine<::testing::Test> {
  Bullet() : OnEngine("bullet") {}
};

constexpr double kAlgebra = 1e-9;  // rounding of a few hundred steps

// Bullet's default damping of 0.04 would take a third of it.
TEST_F(Bullet, FreeSpinKeepsItsMomentum) {
  Scene scene;
  scene.robot = test::sledge();
  scene.partner = PartnerMode::kNone;
  scene.gravity.setZero();
  const auto backend = make_backend("bullet", scene);
  RobotState state = test::state_of(*scene.robot, {0.0, 0.0, 50.0});
  state.v_WB = {1.0, -2.0, 0.5};
  state.w_WB_B = {0.0, 5.0, 0.0};
  backend->reset(state);
  for (int i = 0; i < 5000; ++i) backend->step(test::no_torque(*scene.robot));
  EXPECT_NEAR((backend->state().v_WB - state.v_WB).norm(), 0.0, kAlgebra);
  EXPECT_NEAR((backend->state().w_WB_B - state.w_WB_B).norm(), 0.0, kAlgebra);
}

// The free box of the Gazebo benchmark (bullet3#4636 reports a drift of its linear velocity under Bullet's defaults).
// Linear momentum is exact; angular momentum and energy drift at the first order of the step, as in any Euler step.
TEST_F(Bullet, TumblingBoxDriftsAtFirstOrderInAngularMomentumOnly) {
  Scene scene;
  auto robot = std::make_shared<RobotModel>();
  robot->name = "box";
  robot->links = {test::box_link("base", 10.0)};
  robot->links[0].inertia = Eigen::Vector3d(0.80833, 0.68333, 0.14167).asDiagonal();
  robot->neutral = Eigen::VectorXd::Zero(0);
  scene.robot = robot;
  scene.partner = PartnerMode::kNone;
  RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
  state.v_WB = {-2.0, 2.0, 8.0};
  state.w_WB_B = {0.1, 5.0, 0.1};
  const Eigen::Matrix3d& I = robot->links[0].inertia;
  const auto momentum = [&](const RobotState& at) { return Eigen::Vector3d(at.X_WB.R * (I * at.w_WB_B)); };
  std::vector<double> drift;
  for (const double dt : {0.002, 0.001}) {
    scene.dt = dt;
    const auto backend = make_backend("bullet", scene);
    backend->reset(state);
    double linear = 0.0, angular = 0.0, over = 0.0;
    for (int i = 0; i < static_cast<int>(std::lround(10.0 / dt)); ++i) {
      backend->step(test::no_torque(*robot));
      const RobotState& now = backend->state();
      linear = std::max(linear, (now.v_WB - state.v_WB - backend->time() * scene.gravity).norm());
      angular = std::max(angular, (momentum(now) - momentum(state)).norm() / momentum(state).norm());
      over = std::min(over, now.w_WB_B.y());
    }
    EXPECT_LT(over, -4.0);  // it tumbles
    EXPECT_LT(linear, kAlgebra);
    drift.push_back(angular);
  }
  EXPECT_LT(drift[0], 0.03);
  EXPECT_NEAR(drift[1] / drift[0], 0.5, 0.05);
}

// Bullet leaves out a joint limit between links without colliders, as these are.
TEST_F(Bullet, AWristHoldsAtItsStop) {
  const auto robot = test::g1();
  const auto backend = make(robot);
  RobotState state = robot->standing_state();
  state.X_WB.p.z() = 50.0;
  backend->reset(state);
  const int wrist = robot->joint_index("left_wrist_pitch_joint");
  JointCommand command = robot->default_command(robot->neutral);
  command.tau_ff[wrist] = 5.0;
  command.kp[wrist] = 0.0;
  double highest = 0.0;
  for (int i = 0; i < 500; ++i) {
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    highest = std::max(highest, backend->state().q[wrist]);
  }
  EXPECT_NEAR(backend->state().q[wrist], robot->joints[wrist].upper, 1e-3);
  EXPECT_LT(highest, robot->joints[wrist].upper + 0.01);
}

// All joints swing by 1.2 rad, 1.5 times a second, while it falls: stops, ground and limits of effort at once.
TEST_F(Bullet, EffortAndStopsHoldInThrashing) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("bullet", scene);
  backend->reset(robot.standing_state());
  JointCommand command = robot.default_command(robot.neutral);
  double violation = 0.0;
  int saturated = 0;
  for (int i = 0; i < 1000; ++i) {
    for (int k = 0; k < robot.dof(); ++k)
      command.q_target[k] = robot.neutral[k] + 1.2 * std::sin(2.0 * M_PI * 1.5 * i * scene.dt + 1.7 * k);
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_LT(backend->state().v.cwiseAbs().maxCoeff(), 200.0);
    violation = std::max(violation, test::largest_violation(robot, backend->state()));
    for (int k = 0; k < robot.dof(); ++k) {
      ASSERT_LE(std::abs(backend->torques()[k]), robot.joints[k].effort);
      if (std::abs(backend->torques()[k]) == robot.joints[k].effort) ++saturated;
    }
  }
  EXPECT_GT(saturated, 100);
  EXPECT_LT(violation, 0.1);
}

TEST_F(Bullet, RefusesOptionsThatItDoesNotHave) {
  Scene scene = test::g1_scene();
  scene.options = {{"iteration", "20"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("bullet", scene); }).find("iterations"),
            std::string::npos);
  scene.options = {{"slop", "1"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("bullet", scene); }).find("slop"),
            std::string::npos);
}

TEST_F(Bullet, OptionsReachTheSolver) {
  // The sledge, put 0.1 mm into the ground, after five steps: slop + (1 - erp)^5 of the rest.
  const auto depth = [](const EngineOptions& options) {
    Scene scene;
    scene.robot = test::sledge();
    scene.partner = PartnerMode::kNone;
    scene.options = options;
    const auto backend = make_backend("bullet", scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 0.0999}));
    for (int i = 0; i < 5; ++i) backend->step(test::no_torque(*scene.robot));
    return 0.1 - backend->state().X_WB.p.z();
  };
  EXPECT_NEAR(depth({{"erp", "0.2"}}), 1e-5 + 9e-5 * std::pow(0.8, 5), 1e-8);
  EXPECT_NEAR(depth({{"erp", "0.05"}}), 1e-5 + 9e-5 * std::pow(0.95, 5), 1e-8);
  EXPECT_NEAR(depth({{"erp", "0.2"}, {"slop", "2e-5"}}), 2e-5 + 8e-5 * std::pow(0.8, 5), 1e-8);
  EXPECT_NEAR(depth({{"erp", "1"}, {"push_out", "0.002"}}), 1e-4 - 5 * 0.002 * 0.002, 1e-8);
  EXPECT_GT(std::abs(depth({{"iterations", "1"}}) - depth({{"iterations", "100"}})), 1e-9);

  auto robot = test::wheel();
  Scene scene;
  scene.robot = robot;
  scene.partner = PartnerMode::kNone;
  scene.options = {{"stop_erp", "0.5"}};
  const auto backend = make_backend("bullet", scene);
  RobotState beyond = test::state_of(*robot, {0.0, 0.0, 1000.0});
  beyond.q[0] = 1.08;
  backend->reset(beyond);
  backend->step(test::no_torque(*robot));
  EXPECT_NEAR(backend->state().q[0], 1.04, 1e-6);
}

struct BulletContact : test::ContactScene {
  BulletContact() : ContactScene("bullet") {}
};

TEST_F(BulletContact, TooManyContactsWithTheHumanAreAnErrorThatSaysSo) {
  auto robot = test::sledge();
  robot->shapes.resize(100, robot->shapes[3]);  // in one place
  scene.robot = robot;
  scene.human.capsules.resize(2, scene.human.capsules[0]);
  scene.partner = PartnerMode::kSolid;
  RobotState flying = rest;
  flying.X_WB.p.z() = 100.0;
  start(flying);
  backend->set_partner(test::hand_before_sledge(flying, -0.001), HumanJoints::Zero());
  const std::string message = test::thrown_message<std::runtime_error>([&] { backend->step(test::no_torque(*robot)); });
  EXPECT_EQ(message.rfind("bullet: more than", 0), 0U) << message;
}

}  // namespace
}  // namespace duet
