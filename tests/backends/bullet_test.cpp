// Bullet against closed forms: fall, spin, one joint under the torque law, stops, and the repeatability of runs.
#include <cmath>

#include "duet/backends/factory.h"
#include "duet/core/random.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"
#include "tests/backends/contact_scene.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

bool bullet_is_here() {
  for (const EngineInfo& info : engines())
    if (info.name == "bullet") return info.available;
  return false;
}

struct Bullet : ::testing::Test {
  void SetUp() override {
    if (!bullet_is_here()) GTEST_SKIP() << "not run: engine bullet absent";
  }
  static std::unique_ptr<Backend> make(std::shared_ptr<const RobotModel> robot, double dt = 0.002) {
    Scene scene;
    scene.robot = std::move(robot);
    scene.partner = PartnerMode::kNone;
    scene.dt = dt;
    scene.self_collision = false;
    return make_backend("bullet", scene);
  }
};

constexpr double kAlgebra = 1e-9;  // rounding of a few hundred steps

TEST_F(Bullet, ReportsVelocitiesInOurFrames) {
  // The origin of the base is not its centre of mass, about which it turns.
  auto robot = test::sledge();
  robot->links[0].com = {0.2, 0.0, 0.0};
  const auto backend = make(robot);
  RobotState state = test::state_of(*robot, {0.0, 0.0, 50.0});
  state.X_WB.R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -1.0).normalized());
  state.w_WB_B = {0.0, 0.0, 2.0};  // about a principal axis: constant in B
  state.v_WB = -(state.X_WB.R * state.w_WB_B.cross(robot->links[0].com));
  backend->reset(state);
  const Eigen::Vector3d com = state.X_WB * robot->links[0].com;
  for (int i = 0; i < 100; ++i) backend->step(test::no_torque(*robot));
  const double t = backend->time();
  const RobotState& now = backend->state();
  const Eigen::Quaterniond turned = state.X_WB.R * yaw_rotation(2.0 * t);
  EXPECT_NEAR(now.X_WB.R.angularDistance(turned), 0.0, 1e-7);
  EXPECT_NEAR((now.w_WB_B - state.w_WB_B).norm(), 0.0, kAlgebra);
  const Eigen::Vector3d fallen = com - Eigen::Vector3d(0.0, 0.0, 0.5 * kGravity * t * (t + backend->scene().dt));
  EXPECT_NEAR((now.X_WB * robot->links[0].com - fallen).norm(), 0.0, kAlgebra);
  const Eigen::Vector3d v_WCom = now.v_WB + now.X_WB.R * now.w_WB_B.cross(robot->links[0].com);
  EXPECT_NEAR((v_WCom - Eigen::Vector3d(0.0, 0.0, -kGravity * t)).norm(), 0.0, kAlgebra);
}

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

struct BulletWheel : Bullet {
  void SetUp() override {
    Bullet::SetUp();
    if (IsSkipped()) return;
    backend = make(test::wheel());
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command = test::no_torque(*backend->scene().robot);
  }
  std::unique_ptr<Backend> backend;
  JointCommand command;
};

TEST_F(BulletWheel, StopsAtItsLimits) {
  for (const double side : {1.0, -1.0}) {
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command.tau_ff[0] = side * 10.0;
    double farthest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      farthest = std::max(farthest, side * backend->state().q[0]);
    }
    EXPECT_LT(farthest, 1.0 + 0.04);  // arrives at 16 rad/s: 0.032 rad a step
    EXPECT_NEAR(backend->state().q[0], side, 1e-3);
    EXPECT_NEAR(backend->state().v[0], 0.0, 1e-3);
  }
}

TEST_F(Bullet, DivergenceIsAValueAndFinalUntilReset) {
  auto robot = test::wheel();
  robot->joints[0].effort = 1e300;
  const auto backend = make(robot);
  const RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
  backend->reset(state);
  JointCommand command = test::no_torque(*robot);
  for (const double torque : {1e200, 1e300}) {
    backend->reset(state);
    command.tau_ff[0] = torque;
    Outcome outcome = Outcome::kOk;
    for (int i = 0; i < 10 && outcome == Outcome::kOk; ++i) outcome = backend->step(command);
    EXPECT_EQ(outcome, Outcome::kDiverged) << torque;
    EXPECT_TRUE(backend->state().q.allFinite());
    EXPECT_EQ(backend->step(test::no_torque(*robot)), Outcome::kDiverged);
  }
  backend->reset(state);
  EXPECT_EQ(backend->step(test::no_torque(*robot)), Outcome::kOk);
  EXPECT_LT(std::abs(backend->state().v[0]), 1e-9);  // nothing is left of those torques
}

TEST_F(Bullet, AccelerationsAgreeWithOurDynamics) {
  const auto backend = make(test::g1(), 1e-6);
  const RobotModel& robot = *backend->scene().robot;
  Random random(1, 2);
  for (int trial = 0; trial < 3; ++trial) {
    RobotState state = test::state_of(robot, {0.0, 0.0, 50.0});
    state.X_WB.R = Eigen::AngleAxisd(1.0, Eigen::Vector3d(0.1, 0.7, -0.3).normalized());
    state.w_WB_B = {random.normal(), random.normal(), random.normal()};
    state.v_WB = {random.normal(), random.normal(), random.normal()};
    for (int i = 0; i < robot.dof(); ++i) {
      state.q[i] = std::clamp(0.1 * random.normal(), robot.joints[i].lower + 0.05, robot.joints[i].upper - 0.05);
      state.v[i] = random.normal();
    }
    JointCommand command = test::no_torque(robot);
    for (int i = 0; i < robot.dof(); ++i) command.tau_ff[i] = random.normal();
    const int n = 6 + robot.dof();
    Eigen::VectorXd bias(n), force = Eigen::VectorXd::Zero(n);
    Eigen::MatrixXd mass(n, n);
    bias_forces(robot, state, bias);
    mass_matrix(robot, state, mass);
    force.tail(robot.dof()) = command.tau_ff;
    const Eigen::VectorXd expected = mass.llt().solve(force - bias);
    backend->reset(state);
    backend->step(command);
    Eigen::VectorXd found(n);
    found << backend->state().v_WB - state.v_WB, backend->state().w_WB_B - state.w_WB_B, backend->state().v - state.v;
    found /= backend->scene().dt;
    EXPECT_LT((found - expected).norm() / expected.norm(), 1e-6);
  }
}

// Free flight of the moving G1 against our own dynamics: the error halves with dt.
TEST_F(Bullet, TrajectoriesConvergeToOurDynamicsAtFirstOrder) {
  const auto robot = test::g1();
  const int n = 6 + robot->dof();
  RobotState start = test::state_of(*robot, {0.0, 0.0, 50.0});
  Random random(3, 1);
  for (int i = 0; i < robot->dof(); ++i) {
    start.q[i] = 0.5 * (robot->joints[i].lower + robot->joints[i].upper);
    start.v[i] = random.normal();
  }
  start.w_WB_B = {1.0, -0.5, 0.7};
  const double duration = 0.1;
  RobotState reference = start;  // semi-implicit Euler at a hundredth of the step
  Dynamics dynamics(*robot);
  const double small = 1e-5;
  for (int i = 0; i < static_cast<int>(std::lround(duration / small)); ++i) {
    dynamics.update(reference);
    Eigen::MatrixXd mass = dynamics.mass();
    for (int j = 0; j < robot->dof(); ++j) mass(6 + j, 6 + j) += robot->joints[j].armature;
    const Eigen::VectorXd a = mass.llt().solve(Eigen::VectorXd(-dynamics.bias()));
    reference.v_WB += small * a.head<3>();
    reference.w_WB_B += small * a.segment<3>(3);
    reference.v += small * a.tail(n - 6);
    reference.X_WB.p += small * reference.v_WB;
    const double angle = small * reference.w_WB_B.norm();
    reference.X_WB.R =
        (reference.X_WB.R * Eigen::Quaterniond(Eigen::AngleAxisd(angle, reference.w_WB_B.normalized()))).normalized();
    reference.q += small * reference.v;
  }
  double errors[2];
  int k = 0;
  for (const double dt : {0.002, 0.001}) {
    const auto backend = make(robot, dt);
    backend->reset(start);
    for (int i = 0; i < static_cast<int>(std::lround(duration / dt)); ++i) backend->step(test::no_torque(*robot));
    errors[k++] = (backend->state().q - reference.q).cwiseAbs().maxCoeff();
  }
  EXPECT_LT(errors[0], 5e-3);
  EXPECT_LT(errors[1], 0.65 * errors[0]);
}

double largest_violation(const RobotModel& robot, const RobotState& state) {
  double largest = 0.0;
  for (int i = 0; i < robot.dof(); ++i)
    largest = std::max({largest, robot.joints[i].lower - state.q[i], state.q[i] - robot.joints[i].upper});
  return largest;
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

TEST_F(Bullet, AllJointsHoldAtTheirStops) {
  const auto robot = test::g1();
  const auto backend = make(robot);
  RobotState state = robot->standing_state();
  state.X_WB.p.z() = 50.0;
  backend->reset(state);
  const JointCommand command = robot->default_command(robot->upper() + Eigen::VectorXd::Constant(robot->dof(), 0.3));
  for (int i = 0; i < 500; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_LT(largest_violation(*robot, backend->state()), 0.01);
  EXPECT_LT(backend->state().v.cwiseAbs().maxCoeff(), 0.05);
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
    violation = std::max(violation, largest_violation(robot, backend->state()));
    for (int k = 0; k < robot.dof(); ++k) {
      ASSERT_LE(std::abs(backend->torques()[k]), robot.joints[k].effort);
      if (std::abs(backend->torques()[k]) == robot.joints[k].effort) ++saturated;
    }
  }
  EXPECT_GT(saturated, 100);
  EXPECT_LT(violation, 0.1);
}

TEST_F(Bullet, StandsAndCarriesItsWeight) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("bullet", scene);
  backend->reset(robot.standing_state());
  // The card's gains hold a pose, not the balance: an ankle strategy on the centre of mass does.
  JointCommand command = robot.default_command(robot.neutral);
  Kinematics kinematics(robot);
  const std::array<int, 2> pitch = {robot.joint_index("left_ankle_pitch_joint"),
                                    robot.joint_index("right_ankle_pitch_joint")};
  Eigen::MatrixXd J(3, 6 + robot.dof());
  Eigen::VectorXd v(6 + robot.dof());
  double force = 0.0;
  const int steps = 1000;
  for (int i = 0; i < steps; ++i) {
    const RobotState& state = backend->state();
    kinematics.update(state.X_WB, state.q);
    kinematics.center_of_mass_jacobian(J);
    v << state.v_WB, state.w_WB_B, state.v;
    double soles = 0.0;
    for (const int foot : robot.feet)
      soles += kinematics.shape_position(foot).x() / static_cast<double>(robot.feet.size());
    const double ahead = (kinematics.center_of_mass().x() - soles) / 0.65, ahead_rate = J.row(0).dot(v) / 0.65;
    for (const int joint : pitch)
      command.q_target[joint] = robot.neutral[joint] + std::clamp(4.0 * ahead + 1.2 * ahead_rate, -0.3, 0.3);
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_GT(state.X_WB.p.z(), 0.65) << backend->time();
    if (i < steps - 100) continue;
    for (const Contact& contact : backend->contacts()) force += contact.f_W.z() / 100.0;
  }
  const double weight = robot.total_mass() * kGravity;
  EXPECT_NEAR(force, weight, 1e-3 * weight);
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
