// DART against closed forms: fall, one joint under the torque law, stops, the repeatability of runs, and the traps of
// its Debian build: it prints, it ends the process at a NaN, and a detector of it brings a second Bullet.
#include <cmath>
#include <fstream>

#include "duet/backends/factory.h"
#include "duet/backends/implicit_law.h"
#include "duet/core/random.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

bool dart_is_here() {
  for (const EngineInfo& info : engines())
    if (info.name == "dart") return info.available;
  return false;
}

struct Dart : ::testing::Test {
  void SetUp() override {
    if (!dart_is_here()) GTEST_SKIP() << "not run: engine dart absent";
  }
  static std::unique_ptr<Backend> make(std::shared_ptr<const RobotModel> robot, double dt = 0.002) {
    Scene scene;
    scene.robot = std::move(robot);
    scene.partner = PartnerMode::kNone;
    scene.dt = dt;
    return make_backend("dart", scene);
  }
};

constexpr double kAlgebra = 1e-9;  // rounding of a few hundred steps

TEST_F(Dart, ReportsVelocitiesInOurFrames) {
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
  // The velocity of the origin is integrated, not that of the centre: first order in dt.
  const double drift = backend->scene().dt * 2.0 * 2.0 * 0.2;
  EXPECT_NEAR((now.X_WB * robot->links[0].com - fallen).norm(), 0.0, drift * t);
  const Eigen::Vector3d v_WCom = now.v_WB + now.X_WB.R * now.w_WB_B.cross(robot->links[0].com);
  EXPECT_NEAR((v_WCom - Eigen::Vector3d(0.0, 0.0, -kGravity * t)).norm(), 0.0, drift);
}

TEST_F(Dart, TumblingBoxKeepsMomentumAndEnergy) {
  Scene scene;
  scene.robot = test::sledge();
  scene.partner = PartnerMode::kNone;
  scene.gravity.setZero();
  scene.dt = 0.001;
  const auto backend = make_backend("dart", scene);
  RobotState state = test::state_of(*scene.robot, {0.0, 0.0, 50.0});
  state.w_WB_B = {0.3, 3.0, 0.3};  // about the middle axis: unstable
  backend->reset(state);
  const Eigen::Matrix3d I = scene.robot->links[0].inertia;
  const auto momentum = [&] { return Eigen::Vector3d(backend->state().X_WB.R * (I * backend->state().w_WB_B)); };
  const auto energy = [&] { return 0.5 * backend->state().w_WB_B.dot(I * backend->state().w_WB_B); };
  const Eigen::Vector3d L = momentum();
  const double E = energy();
  double turned_over = 0.0;
  for (int i = 0; i < 10000; ++i) {
    backend->step(test::no_torque(*scene.robot));
    turned_over = std::min(turned_over, backend->state().w_WB_B.y());
  }
  EXPECT_LT(turned_over, -2.0);  // it did tumble
  EXPECT_LT((momentum() - L).norm(), 0.02 * L.norm());
  EXPECT_NEAR(energy(), E, 0.02 * E);
}

struct DartWheel : Dart {
  void SetUp() override {
    Dart::SetUp();
    if (IsSkipped()) return;
    backend = make(test::wheel());
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command = test::no_torque(*backend->scene().robot);
  }
  std::unique_ptr<Backend> backend;
  JointCommand command;
};

TEST_F(DartWheel, StopsAtItsLimits) {
  for (const double side : {1.0, -1.0}) {
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command.tau_ff[0] = side * 10.0;
    double farthest = 0.0;
    for (int i = 0; i < 1000; ++i) {
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      farthest = std::max(farthest, side * backend->state().q[0]);
    }
    EXPECT_LT(farthest, 1.0 + 1e-6);  // a step ends at the stop, not beyond it
    EXPECT_NEAR(backend->state().q[0], side, 1e-3);
    EXPECT_NEAR(backend->state().v[0], 0.0, 1e-3);
  }
}

TEST_F(Dart, DivergenceIsAValueAndFinalUntilReset) {
  auto robot = test::wheel();
  robot->joints[0].effort = 1e300;
  const auto backend = make(robot);
  const RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
  backend->reset(state);
  JointCommand command = test::no_torque(*robot);
  for (const double torque : {1e8, 1e200, 1e300}) {
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

double largest_violation(const RobotModel& robot, const RobotState& state) {
  double largest = 0.0;
  for (int i = 0; i < robot.dof(); ++i)
    largest = std::max({largest, robot.joints[i].lower - state.q[i], state.q[i] - robot.joints[i].upper});
  return largest;
}

TEST_F(Dart, AllJointsHoldAtTheirStops) {
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

TEST_F(Dart, StandsAndCarriesItsWeight) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("dart", scene);
  backend->reset(robot.standing_state());
  // The card's gains hold a pose, not the balance: stiffer ankles that follow the centre of mass do.
  JointCommand command = robot.default_command(robot.neutral);
  Kinematics kinematics(robot);
  const std::array<int, 2> pitch = {robot.joint_index("left_ankle_pitch_joint"),
                                    robot.joint_index("right_ankle_pitch_joint")};
  for (const int joint : pitch) {
    command.kp[joint] = 150.0;
    command.kd[joint] = 4.0;
  }
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

// Moving, with velocity products: a step of 1 us against M a = tau - b.
TEST_F(Dart, AccelerationsAgreeWithOurDynamics) {
  const auto backend = make(test::g1(), 1e-6);
  const RobotModel& robot = *backend->scene().robot;
  Random random(1, 2);
  for (int trial = 0; trial < 3; ++trial) {
    RobotState state = test::state_of(robot, {0.0, 0.0, 50.0});
    state.X_WB.R = Eigen::AngleAxisd(1.0, Eigen::Vector3d(0.1, 0.7, -0.3).normalized());
    state.w_WB_B = {random.normal(), random.normal(), random.normal()};
    state.v_WB = {random.normal(), random.normal(), random.normal()};
    JointCommand command = test::no_torque(robot);
    for (int i = 0; i < robot.dof(); ++i) {
      state.q[i] = std::clamp(0.3 * random.normal(), robot.joints[i].lower + 0.05, robot.joints[i].upper - 0.05);
      state.v[i] = random.normal();
      command.tau_ff[i] = random.normal();
    }
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

// In flight, where no contact asks for a second look: some joints at their limits, the others not.
TEST_F(Dart, LawIsTheSharedOneWithItsLimit) {
  Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("dart", scene);
  ImplicitLaw law(scene);
  Random random(4, 2);
  int saturated = 0;
  for (int trial = 0; trial < 20; ++trial) {
    RobotState state = robot.standing_state();
    state.X_WB.p.z() = 50.0;
    JointCommand command = robot.default_command(robot.neutral);
    for (int i = 0; i < robot.dof(); ++i) {
      state.q[i] = 0.5 * (robot.joints[i].lower + robot.joints[i].upper);
      state.v[i] = random.normal();
      command.q_target[i] = state.q[i] + 0.5 * random.normal();
      command.tau_ff[i] = 5.0 * random.normal();
    }
    backend->reset(state);
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_TRUE(law.begin(state, command));
    law.solve(Eigen::VectorXd::Zero(6 + robot.dof()));
    Eigen::VectorXd torques(robot.dof());
    law.torques(law.acceleration(), torques);
    const Eigen::VectorXd v = state.v + scene.dt * law.acceleration().tail(robot.dof());
    EXPECT_LT((backend->state().v - v).norm(), 1e-9 * v.norm());
    EXPECT_LT((backend->torques() - torques).norm(), 1e-6 * torques.norm());
    for (int i = 0; i < robot.dof(); ++i) saturated += std::abs(torques[i]) == robot.joints[i].effort ? 1 : 0;
  }
  EXPECT_GT(saturated, 20);
}

// A contact may drive a joint to its limit within a step: the limit holds there too.
TEST_F(Dart, TorqueStaysWithinTheLimitAtALanding) {
  Scene scene = test::g1_scene();
  RobotModel weak = *scene.robot;
  for (RobotJoint& joint : weak.joints) joint.effort *= 0.3;
  scene.robot = std::make_shared<const RobotModel>(weak);
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("dart", scene);
  RobotState state = robot.standing_state();
  state.X_WB.p.z() += 0.05;
  state.v_WB.z() = -3.0;
  backend->reset(state);
  const JointCommand command = robot.default_command(robot.neutral);
  int at_limit = 0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    for (int j = 0; j < robot.dof(); ++j) {
      EXPECT_LE(std::abs(backend->torques()[j]), (1.0 + 1e-12) * robot.joints[j].effort) << robot.joints[j].name;
      at_limit += std::abs(backend->torques()[j]) == robot.joints[j].effort ? 1 : 0;
    }
  }
  EXPECT_GT(at_limit, 0);
}

// DART's own springs are missing in its answer to contacts: a robot on them falls earlier the longer the step is.
TEST_F(Dart, FallsAtTheSameTimeAtEveryStep) {
  std::vector<double> times;
  for (const double dt : {0.001, 0.002, 0.004}) {
    Scene scene = test::g1_scene();
    scene.dt = dt;
    const auto backend = make_backend("dart", scene);
    backend->reset(scene.robot->standing_state());
    const JointCommand command = scene.robot->default_command(scene.robot->neutral);
    while (backend->state().X_WB.p.z() > 0.45 && backend->time() < 3.0) {
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      if (backend->time() < 0.5) {
        EXPECT_GT(backend->state().X_WB.p.z(), 0.7);
      }
    }
    times.push_back(backend->time());
  }
  for (const double time : times) EXPECT_NEAR(time, times[0], 0.03);
  EXPECT_GT(times[0], 1.0);
  EXPECT_LT(times[0], 2.0);
}

// Stops and contacts are one problem for DART: an arm is pressed against its stop on a robot that stands.
TEST_F(Dart, StopsAndContactsHoldTogether) {
  auto robot = test::sledge();
  RobotLink arm = test::box_link("arm", 2.0);
  arm.parent = 0;
  arm.inertia *= 0.05;
  arm.com = {0.1, 0.0, 0.0};
  arm.axis = Eigen::Vector3d::UnitY();
  robot->links.push_back(arm);
  RobotJoint joint = test::wheel()->joints[0];
  joint.lower = -0.2;
  joint.upper = 0.3;
  robot->joints = {joint};
  robot->neutral = Eigen::VectorXd::Zero(1);
  const auto backend = make(robot);
  backend->reset(test::state_of(*robot, {0.0, 0.0, 0.1}));
  JointCommand command = test::no_torque(*robot);
  command.tau_ff[0] = 5.0;
  for (int i = 0; i < 500; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_NEAR(backend->state().q[0], 0.3, 1e-4);
  EXPECT_NEAR(backend->state().v[0], 0.0, 1e-6);
  const double weight = 12.0 * kGravity;
  double force = 0.0, moment = 0.0;  // about y
  for (const Contact& contact : backend->contacts()) {
    force += contact.f_W.z();
    moment -= (contact.p_WC.x() - backend->state().X_WB.p.x()) * contact.f_W.z();
  }
  EXPECT_NEAR(force, weight, 1e-4 * weight);
  EXPECT_NEAR(moment, -0.1 * std::cos(0.3) * 2.0 * kGravity, 1e-3 * weight);  // the arm's weight, not its drive
}

// DART keeps what it derived from gains as long as the pose stays.
TEST_F(Dart, GainsOfAnEarlierRunLeaveNoTrace) {
  const auto robot = test::wheel();
  const auto backend = make(robot);
  const RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
  JointCommand soft = test::no_torque(*robot), stiff = soft;
  soft.tau_ff[0] = stiff.tau_ff[0] = 0.5;
  stiff.kd[0] = 100.0;
  backend->reset(state);
  backend->step(soft);
  const RobotState first = backend->state();
  backend->reset(state);
  backend->step(stiff);
  backend->reset(state);
  backend->step(soft);
  EXPECT_TRUE(test::same(backend->state(), first));
}

// Assertions are on in Debian's libdart: what overflows must not reach it.
TEST_F(Dart, AbsurdNumbersDivergeAndDoNotEndTheProcess) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("dart", scene);
  const RobotState standing = robot.standing_state();
  const JointCommand command = robot.default_command(robot.neutral);
  RobotState state = standing;
  state.v[3] = 1e300;
  backend->reset(state);
  EXPECT_EQ(backend->step(command), Outcome::kDiverged);
  state = standing;
  state.X_WB.p.x() = 1e300;
  backend->reset(state);
  EXPECT_EQ(backend->step(command), Outcome::kDiverged);
  backend->reset(standing);
  backend->push(0, {1e308, 0.0, 1e308}, {1.0, 2.0, 3.0});
  EXPECT_EQ(backend->step(command), Outcome::kDiverged);
  JointCommand absurd = command;
  absurd.kp.setConstant(1e300);
  absurd.q_target.setConstant(1e300);
  backend->reset(standing);
  EXPECT_EQ(backend->step(absurd), Outcome::kDiverged);
  backend->reset(standing);
  EXPECT_EQ(backend->step(command), Outcome::kOk);
}

// Names that occur twice, impulses that are not numbers, limits out of order: DART has messages for all of them.
TEST_F(Dart, PrintsNothing) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  for (int world = 0; world < 2; ++world) {
    const Scene scene = test::g1_scene();
    const auto backend = make_backend("dart", scene);
    backend->reset(scene.robot->standing_state());
    JointCommand command = scene.robot->default_command(scene.robot->neutral);
    for (int i = 0; i < 500; ++i) {
      for (int k = 0; k < scene.robot->dof(); ++k)
        command.q_target[k] = scene.robot->neutral[k] + 1.5 * std::sin(2.0 * M_PI * 1.5 * i * scene.dt + k);
      backend->step(command);
    }
    command.tau_ff.setConstant(1e300);
    backend->step(command);
  }
  const std::string out = testing::internal::GetCapturedStdout(), error = testing::internal::GetCapturedStderr();
  EXPECT_EQ(out, "");
  EXPECT_EQ(error, "");
}

// A capsule that DART's detector would turn into a sphere: it lies on both its ends.
TEST_F(Dart, CapsuleLiesOnBothItsEnds) {
  auto robot = std::make_shared<RobotModel>();
  robot->name = "log";
  robot->links = {test::box_link("log", 5.0)};
  RobotShape shape;
  shape.kind = ShapeKind::kCapsule;
  shape.X_LS.R = Eigen::AngleAxisd(0.5 * M_PI, Eigen::Vector3d::UnitY());
  shape.radius = 0.05;
  shape.half_length = 0.3;
  robot->shapes = {shape};
  robot->neutral = Eigen::VectorXd::Zero(0);
  const auto backend = make(robot);
  backend->reset(test::state_of(*robot, {0.0, 0.0, 0.05}));
  for (int i = 0; i < 500; ++i) ASSERT_EQ(backend->step(test::no_torque(*robot)), Outcome::kOk);
  ASSERT_EQ(backend->contacts().size(), 2U);
  for (const Contact& contact : backend->contacts()) {
    EXPECT_NEAR(std::abs(contact.p_WC.x()), 0.3, 1e-3);
    EXPECT_NEAR(contact.f_W.z(), 0.5 * 5.0 * kGravity, 1e-3 * 5.0 * kGravity);
  }
  EXPECT_NEAR(backend->state().X_WB.p.z(), 0.05, 1e-4);
}

// libdart-collision-bullet would bring the single-precision Bullet, whose symbols are those of the double one.
TEST_F(Dart, BringsNoOtherEngineIntoTheProcess) {
  make(test::wheel());
  std::ifstream maps("/proc/self/maps");
  bool dart_is_loaded = false;
  for (std::string line; std::getline(maps, line);) {
    dart_is_loaded = dart_is_loaded || line.find("libdart.so") != std::string::npos;
    EXPECT_EQ(line.find("libdart-collision-"), std::string::npos) << line;
    EXPECT_EQ(line.find("libBulletCollision.so"), std::string::npos) << line;
  }
  EXPECT_TRUE(dart_is_loaded);
}

TEST_F(Dart, RefusesOptionsThatItDoesNotHave) {
  Scene scene = test::g1_scene();
  scene.options = {{"erpp", "0.2"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("dart", scene); }).find("'erp'"),
            std::string::npos);
  scene.options = {{"solver", "lemke"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("dart", scene); }).find("dantzig"),
            std::string::npos);
}

TEST_F(Dart, OptionsReachTheEngine) {
  const auto height = [](const EngineOptions& options, double seconds) {
    Scene scene;
    scene.robot = test::sledge();
    scene.partner = PartnerMode::kNone;
    scene.options = options;
    const auto backend = make_backend("dart", scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 0.098}));  // 2 mm in the ground
    for (int i = 0; i < static_cast<int>(std::lround(seconds / scene.dt)); ++i)
      backend->step(test::no_torque(*scene.robot));
    return backend->state().X_WB.p.z();
  };
  EXPECT_NEAR(height({{"recovery_speed", "0.01"}, {"erp", "1"}, {"cfm", "0"}}, 0.1), 0.099, 1e-5);
  EXPECT_NEAR(height({{"recovery_speed", "10"}, {"erp", "0.5"}, {"cfm", "0"}}, 0.002), 0.099, 1e-5);
  EXPECT_NEAR(height({{"erp", "0"}, {"cfm", "0"}}, 0.1), 0.098, 1e-9);
  EXPECT_LT(height({{"erp", "0"}, {"cfm", "0.5"}}, 0.1), 0.0975);  // sinks
  const EngineOptions pgs = {{"solver", "pgs"}, {"erp", "0"}, {"cfm", "0"}};
  EngineOptions once = pgs, often = pgs;
  once["pgs_iterations"] = "1";
  often["pgs_iterations"] = "1000";
  EXPECT_NEAR(height(often, 0.1), 0.098, 1e-4);
  EXPECT_GT(std::abs(height(once, 0.1) - 0.098), 1e-4);
}

}  // namespace
}  // namespace duet
