// Every engine against closed forms and against our own dynamics: free bodies, stops, the G1 in flight and on its feet,
// and what becomes of absurd torques. Where engines differ, the row of the engine says by how much and why.
#include <cmath>

#include "duet/backends/engine_module.h"
#include "duet/core/numbers.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kAlgebra = 1e-9;  // rounding of a few hundred steps

// The accuracy that an engine is held to.
struct Accuracy {
  // Whether it moves the centre of mass of a turning body as it falls. Engines in coordinates of joints move the origin
  // of the base: the centre follows to the first order of the step.
  bool moves_the_centre = true;
  // Beyond a stop that is hit at 16 rad/s, 0.032 rad a step; at rest there; speed at rest. [rad], [rad], [rad/s]
  double stop_hit = 1e-6, stop_rest = 1e-3, stop_speed = 1e-3;
  // The G1's joints that are pressed against their stops; Simbody's do not come to rest there. [rad], [rad/s]
  double joint_stops = 0.01, joint_stop_speed = 0.05;
  bool velocity_products_late = false;  // taken in one step later: exact from rest only
};

const Accuracy& accuracy_of(const std::string& engine) {
  static const std::map<std::string, Accuracy> rows = {
      {"mujoco", {.moves_the_centre = false, .stop_hit = 0.1, .stop_rest = 0.005, .joint_stops = 0.05}},
      {"bullet", {.stop_hit = 0.04}},
      {"dart", {.moves_the_centre = false}},
      {"ode", {.stop_hit = 0.04, .velocity_products_late = true}},
      {"simbody", {.moves_the_centre = false, .stop_rest = 1e-6, .stop_speed = 1e-6, .joint_stop_speed = 0.2}}};
  return rows.at(engine);
}

struct EngineDynamics : test::OnEngine<::testing::TestWithParam<std::string>> {
  EngineDynamics() : OnEngine(GetParam()) {}
};
INSTANTIATE_TEST_SUITE_P(Engines, EngineDynamics, ::testing::ValuesIn(test::engine_names()), test::engine_of);

TEST_P(EngineDynamics, ReportsVelocitiesInOurFrames) {
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
  const double t = backend->time(), dt = backend->scene().dt;
  const RobotState& now = backend->state();
  EXPECT_NEAR(now.X_WB.R.angularDistance(state.X_WB.R * yaw_rotation(2.0 * t)), 0.0, 1e-7);
  EXPECT_NEAR((now.w_WB_B - state.w_WB_B).norm(), 0.0, kAlgebra);
  const double drift = accuracy_of(engine).moves_the_centre ? kAlgebra : dt * 2.0 * 2.0 * 0.2;
  const Eigen::Vector3d fallen = com - Eigen::Vector3d(0.0, 0.0, 0.5 * kGravity * t * (t + dt));
  EXPECT_NEAR((now.X_WB * robot->links[0].com - fallen).norm(), 0.0, std::max(kAlgebra, drift * t));
  const Eigen::Vector3d v_WCom = now.v_WB + now.X_WB.R * now.w_WB_B.cross(robot->links[0].com);
  EXPECT_NEAR((v_WCom - Eigen::Vector3d(0.0, 0.0, -kGravity * t)).norm(), 0.0, drift);
}

TEST_P(EngineDynamics, ATumblingBoxKeepsMomentumAndEnergy) {
  const auto robot = test::sledge();
  const auto backend = make(robot, 0.001, Eigen::Vector3d::Zero());
  RobotState state = test::state_of(*robot, {0.0, 0.0, 50.0});
  state.w_WB_B = {0.3, 3.0, 0.3};  // about the middle axis: unstable
  backend->reset(state);
  const Eigen::Matrix3d I = robot->links[0].inertia;
  const auto momentum = [&] { return Eigen::Vector3d(backend->state().X_WB.R * (I * backend->state().w_WB_B)); };
  const auto energy = [&] { return 0.5 * backend->state().w_WB_B.dot(I * backend->state().w_WB_B); };
  const Eigen::Vector3d L = momentum();
  const double E = energy();
  double turned_over = 0.0;
  for (int i = 0; i < 10000; ++i) {
    backend->step(test::no_torque(*robot));
    turned_over = std::min(turned_over, backend->state().w_WB_B.y());
  }
  EXPECT_LT(turned_over, -2.0);  // it did tumble
  EXPECT_LT((momentum() - L).norm(), 0.02 * L.norm());
  EXPECT_NEAR(energy(), E, 0.02 * E);
}

TEST_P(EngineDynamics, AJointStopsAtItsLimits) {
  const auto backend = make(test::wheel());
  const RobotState start = test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0});
  JointCommand command = test::no_torque(*backend->scene().robot);
  const Accuracy& accuracy = accuracy_of(engine);
  for (const double side : {1.0, -1.0}) {
    backend->reset(start);
    command.tau_ff[0] = side * 10.0;
    double farthest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      farthest = std::max(farthest, side * backend->state().q[0]);
    }
    EXPECT_LT(farthest, 1.0 + accuracy.stop_hit);
    EXPECT_NEAR(backend->state().q[0], side, accuracy.stop_rest);
    EXPECT_NEAR(backend->state().v[0], 0.0, accuracy.stop_speed);
  }
}

TEST_P(EngineDynamics, DivergenceIsAValueAndFinalUntilReset) {
  auto robot = test::wheel();
  robot->joints[0].effort = 1e300;
  const auto backend = make(robot);
  const RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
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

// One step against M a = tau - b: from rest, and where the engine takes velocity products at once, in motion too.
TEST_P(EngineDynamics, AccelerationsAgreeWithOurDynamics) {
  const bool moving = !accuracy_of(engine).velocity_products_late;
  const auto backend = make(test::g1(), moving ? 1e-6 : 1e-3);
  const RobotModel& robot = *backend->scene().robot;
  const int n = 6 + robot.dof();
  Random random(1, 2);
  for (int trial = 0; trial < 3; ++trial) {
    RobotState state = test::state_of(robot, {0.0, 0.0, 50.0});
    state.X_WB.R = Eigen::AngleAxisd(1.0, Eigen::Vector3d(0.1, 0.7, -0.3).normalized());
    if (moving) state.w_WB_B = {random.normal(), random.normal(), random.normal()};
    if (moving) state.v_WB = {random.normal(), random.normal(), random.normal()};
    JointCommand command = test::no_torque(robot);
    for (int i = 0; i < robot.dof(); ++i) {
      state.q[i] = std::clamp(0.1 * random.normal(), robot.joints[i].lower + 0.05, robot.joints[i].upper - 0.05);
      if (moving) state.v[i] = random.normal();
      command.tau_ff[i] = random.normal();
    }
    Eigen::VectorXd bias(n), force = Eigen::VectorXd::Zero(n), found(n);
    Eigen::MatrixXd mass(n, n);
    bias_forces(robot, state, bias);
    mass_matrix(robot, state, mass);
    force.tail(robot.dof()) = command.tau_ff;
    const Eigen::VectorXd expected = mass.llt().solve(force - bias);
    backend->reset(state);
    backend->step(command);
    found << backend->state().v_WB - state.v_WB, backend->state().w_WB_B - state.w_WB_B, backend->state().v - state.v;
    found /= backend->scene().dt;
    EXPECT_LT((found - expected).norm() / expected.norm(), 1e-6);
  }
}

// Where the G1 is after `duration` in free flight without torques: semi-implicit Euler in steps of 10 us.
RobotState flight(const RobotModel& robot, RobotState state, double duration) {
  Dynamics dynamics(robot);
  const double dt = 1e-5;
  for (int i = 0; i < static_cast<int>(std::lround(duration / dt)); ++i) {
    dynamics.update(state);
    Eigen::MatrixXd mass = dynamics.mass();
    for (int j = 0; j < robot.dof(); ++j) mass(6 + j, 6 + j) += robot.joints[j].armature;
    const Eigen::VectorXd a = mass.llt().solve(Eigen::VectorXd(-dynamics.bias()));
    state.v_WB += dt * a.head<3>();
    state.w_WB_B += dt * a.segment<3>(3);
    state.v += dt * a.tail(robot.dof());
    state.X_WB.p += dt * state.v_WB;
    const Eigen::AngleAxisd turn(dt * state.w_WB_B.norm(), state.w_WB_B.normalized());
    state.X_WB.R = (state.X_WB.R * Eigen::Quaterniond(turn)).normalized();
    state.q += dt * state.v;
  }
  return state;
}

TEST_P(EngineDynamics, FlightsConvergeToOurDynamicsAtFirstOrder) {
  const auto robot = test::g1();
  RobotState start = test::state_of(*robot, {0.0, 0.0, 50.0});
  Random random(3, 1);
  for (int i = 0; i < robot->dof(); ++i) {
    start.q[i] = 0.5 * (robot->joints[i].lower + robot->joints[i].upper);
    start.v[i] = random.normal();
  }
  start.w_WB_B = {1.0, -0.5, 0.7};
  const double duration = 0.1;
  const RobotState reference = flight(*robot, start, duration);
  std::vector<double> errors;
  for (const double dt : {0.002, 0.001}) {
    const auto backend = make(robot, dt);
    backend->reset(start);
    for (int i = 0; i < static_cast<int>(std::lround(duration / dt)); ++i) backend->step(test::no_torque(*robot));
    errors.push_back((backend->state().q - reference.q).cwiseAbs().maxCoeff());
  }
  EXPECT_LT(errors[0], 5e-3);
  EXPECT_LT(errors[1], 0.65 * errors[0]);
}

TEST_P(EngineDynamics, AllJointsHoldAtTheirStops) {
  const auto robot = test::g1();
  const auto backend = make(robot);
  RobotState state = robot->standing_state();
  state.X_WB.p.z() = 50.0;
  backend->reset(state);
  const JointCommand command = robot->default_command(robot->upper() + Eigen::VectorXd::Constant(robot->dof(), 0.3));
  for (int i = 0; i < 500; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_LT(test::largest_violation(*robot, backend->state()), accuracy_of(engine).joint_stops);
  EXPECT_LT(backend->state().v.cwiseAbs().maxCoeff(), accuracy_of(engine).joint_stop_speed);
}

// The card's gains hold a pose, not the balance: stiffer ankles that follow the centre of mass do.
TEST_P(EngineDynamics, TheG1StandsAndCarriesItsWeight) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend(engine, scene);
  backend->reset(robot.standing_state());
  JointCommand command = robot.default_command(robot.neutral);
  const std::array<int, 2> pitch = {robot.joint_index("left_ankle_pitch_joint"),
                                    robot.joint_index("right_ankle_pitch_joint")};
  for (const int joint : pitch) {
    command.kp[joint] = 150.0;
    command.kd[joint] = 4.0;
  }
  Kinematics kinematics(robot);
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
      command.q_target[joint] = robot.neutral[joint] + std::clamp(1.5 * ahead + 0.35 * ahead_rate, -0.3, 0.3);
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_GT(state.X_WB.p.z(), 0.65) << backend->time();
    if (i < steps - 100) continue;
    for (const Contact& contact : backend->contacts()) force += contact.f_W.z() / 100.0;
  }
  const double weight = robot.total_mass() * kGravity;
  EXPECT_NEAR(force, weight, 1e-3 * weight);
}

}  // namespace
}  // namespace duet
