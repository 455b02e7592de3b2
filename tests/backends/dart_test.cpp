// DART: the torque law and contacts of its own, and the traps of its Debian build: it prints, it ends the process at a
// NaN, and a detector of it brings a second Bullet. Laws of every engine are in engine_*_test.cpp.
#include <cmath>
#include <fstream>

#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/numbers.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Dart : test::OnEngine<::testing::Test> {
  Dart() : OnEngine("dart") {}
};

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
