// Laws of free bodies, of one joint under the torque law and of the repeatability of runs in every engine.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <thread>

#include "duet/backends/engine_module.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "tests/backends/allocation_count.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/backends/trace.h"
#include "tests/support.h"

namespace duet {
namespace {

using engine_layout::Digest;
using test::fall;
using test::Trace;

constexpr double kAlgebra = 1e-9;  // rounding of a few hundred steps

// Rounding of a constant torque as reported: MuJoCo and Simbody give it exactly, others as their step solves for it.
double torque_rounding(const std::string& engine) { return engine == "mujoco" || engine == "simbody" ? 0.0 : kAlgebra; }

struct Engine : test::OnEngine<::testing::TestWithParam<std::string>> {
  Engine() : OnEngine(GetParam()) {}
};
INSTANTIATE_TEST_SUITE_P(Engines, Engine, ::testing::ValuesIn(test::engine_names()), test::engine_of);

struct EngineWheel : Engine {
  void SetUp() override {
    Engine::SetUp();
    if (IsSkipped()) return;
    backend = make(test::wheel());
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0}));
    command = test::no_torque(*backend->scene().robot);
  }
  static constexpr double kInertia = test::kWheelInertia + test::kWheelArmature;
  std::unique_ptr<Backend> backend;
  JointCommand command;
};
INSTANTIATE_TEST_SUITE_P(Engines, EngineWheel, ::testing::ValuesIn(test::engine_names()), test::engine_of);

TEST_P(Engine, FallsAsSemiImplicitEulerDoes) {
  const auto backend = make(test::sledge());
  RobotState state = test::state_of(*backend->scene().robot, {0.3, -0.2, 50.0});
  state.v_WB = {1.0, 2.0, 3.0};
  backend->reset(state);
  const int steps = 250;
  for (int i = 0; i < steps; ++i) ASSERT_EQ(backend->step(test::no_torque(*backend->scene().robot)), Outcome::kOk);
  const double t = backend->time(), dt = backend->scene().dt;
  EXPECT_NEAR(backend->state().X_WB.p.x(), 0.3 + t, kAlgebra);
  EXPECT_NEAR(backend->state().X_WB.p.y(), -0.2 + 2.0 * t, kAlgebra);
  EXPECT_NEAR(backend->state().X_WB.p.z(), 50.0 + 3.0 * t - 0.5 * kGravity * t * (t + dt), kAlgebra);
  EXPECT_NEAR(backend->state().v_WB.z(), 3.0 - kGravity * t, kAlgebra);
}

TEST_P(EngineWheel, TurnsWithItsArmature) {
  command.tau_ff[0] = 0.5;
  for (int i = 0; i < 100; ++i) backend->step(command);
  EXPECT_NEAR(backend->state().v[0], 0.5 / kInertia * backend->time(), 1e-6);  // the base gives way by 1e-6
  EXPECT_NEAR(backend->torques()[0], 0.5, torque_rounding(engine));
}

TEST_P(EngineWheel, FollowsTheTorqueLawTakenImplicitly) {
  command.q_target[0] = 0.2;
  command.tau_ff[0] = 0.3;
  double q = 0.0, v = 0.0;
  const double dt = backend->scene().dt;
  for (int i = 0; i < 400; ++i) {
    const double kp = i < 200 ? 8.0 : 20.0, kd = i < 200 ? 0.9 : 0.3;  // gains may change at every step
    command.kp[0] = kp;
    command.kd[0] = kd;
    backend->step(command);
    const double a = (kp * (0.2 - q - dt * v) - kd * v + 0.3) / (kInertia + dt * kd + dt * dt * kp);
    v += dt * a;
    q += dt * v;
    ASSERT_NEAR(backend->state().q[0], q, 1e-6);
    ASSERT_NEAR(backend->state().v[0], v, 1e-6);
    ASSERT_NEAR(backend->torques()[0], kp * (0.2 - q) - kd * v + 0.3, 1e-4);
  }
}

TEST_P(EngineWheel, ClampsTheWholeLawNotItsSpring) {
  command.tau_ff[0] = 100.0;  // effort is 10
  backend->step(command);
  EXPECT_EQ(backend->torques()[0], 10.0);
  EXPECT_NEAR(backend->state().v[0], 10.0 / kInertia * backend->scene().dt, 1e-6);
  RobotState state = test::state_of(*backend->scene().robot, {0.0, 0.0, 1000.0});
  state.v[0] = 20.0;
  backend->reset(state);
  command.tau_ff[0] = 0.0;
  command.kd[0] = 5.0;  // asks for -100
  backend->step(command);
  EXPECT_EQ(backend->torques()[0], -10.0);
  EXPECT_NEAR(backend->state().v[0], 20.0 - 10.0 / kInertia * backend->scene().dt, 1e-5);
}

// At a stop the joint is stopped within a step: what is reported is the law at the end of that step all the same.
TEST_P(EngineWheel, TheLawHoldsInTheStepOfAStop) {
  command.q_target[0] = 1.5;
  command.kp[0] = 4.0;
  command.kd[0] = 0.4;
  const double dt = backend->scene().dt;
  double hardest = 0.0;
  for (int i = 0; i < 400; ++i) {
    const double q = backend->state().q[0], before = backend->state().v[0];
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    const double v = backend->state().v[0];
    hardest = std::max(hardest, before - v);
    EXPECT_NEAR(backend->torques()[0], 4.0 * (1.5 - q - dt * v) - 0.4 * v, 1e-4) << i;
  }
  EXPECT_GT(hardest, 1.0);
}

// ODE's own motor of the hinge explodes here: it turns its bound into a raw torque at a stop.
TEST_P(EngineWheel, HoldsStillAtItsStopUnderStiffGains) {
  command.q_target[0] = 3.0;  // 2 rad beyond the stop
  command.kp[0] = 1000.0;
  command.kd[0] = 20.0;
  for (int i = 0; i < 2000; ++i) {
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_LT(std::abs(backend->state().v[0]), 50.0);
  }
  EXPECT_NEAR(backend->state().q[0], 1.0, 1e-3);
  EXPECT_NEAR(backend->state().v[0], 0.0, 1e-6);
}

TEST_P(Engine, JointsMayTurnMoreThanOnceAndStop) {
  auto robot = test::wheel();
  robot->joints[0].lower = -2.0 * M_PI;
  robot->joints[0].upper = 2.0 * M_PI;
  const auto backend = make(robot);
  RobotState state = test::state_of(*robot, {0.0, 0.0, 1000.0});
  state.v[0] = 10.0;
  backend->reset(state);
  JointCommand command = test::no_torque(*robot);
  for (int i = 0; i < 250; ++i) backend->step(command);
  EXPECT_NEAR(backend->state().q[0], 5.0, 1e-3);
  command.tau_ff[0] = 5.0;
  for (int i = 0; i < 1000; ++i) backend->step(command);
  EXPECT_NEAR(backend->state().q[0], 2.0 * M_PI, 1e-3);
}

// ODE measures angles up to half a turn only.
TEST_P(Engine, RangesFarFromZeroHaveStops) {
  auto robot = test::wheel();
  robot->joints[0].lower = 2.0;
  robot->joints[0].upper = 5.0;
  robot->neutral[0] = 4.0;
  const auto backend = make(robot);
  backend->reset(test::state_of(*robot, {0.0, 0.0, 1000.0}));
  JointCommand command = test::no_torque(*robot);
  command.tau_ff[0] = 5.0;
  for (int i = 0; i < 1000; ++i) backend->step(command);
  EXPECT_NEAR(backend->state().q[0], 5.0, 1e-3);
}

// A second wheel on the base listed between a wheel and its child: breadth-first, unlike the order of some engines.
TEST_P(Engine, BranchedTreesKeepTheCardsJointOrder) {
  auto robot = test::wheel();
  RobotLink second = robot->links[1], child = robot->links[1];
  second.name = "second";
  child.name = "child";
  child.parent = 1;
  robot->links.insert(robot->links.end(), {second, child});
  robot->joints.resize(3, robot->joints[0]);
  robot->neutral = Eigen::VectorXd::Zero(3);
  const auto backend = make(robot);
  backend->reset(test::state_of(*robot, {0.0, 0.0, 1000.0}));
  JointCommand command = test::no_torque(*robot);
  command.tau_ff[1] = 0.5;
  for (int i = 0; i < 10; ++i) backend->step(command);
  EXPECT_GT(backend->state().q[1], 1e-4);
  EXPECT_NEAR(backend->state().q[0], 0.0, 1e-9);
  EXPECT_NEAR(backend->state().q[2], 0.0, 1e-9);
}

TEST_P(Engine, RunsAgainBitwiseAfterResetInAFreshWorldAndInAnotherThread) {
  const Scene scene = test::g1_scene();
  const auto backend = make_backend(engine, scene);
  backend->reset(scene.robot->standing_state());
  const Trace first = fall(*backend, 0, 1000);
  backend->reset(scene.robot->standing_state());
  EXPECT_TRUE(same(fall(*backend, 0, 1000), first));
  Trace other;
  std::thread thread([&] {
    const auto fresh = make_backend(engine, scene);
    fresh->reset(scene.robot->standing_state());
    other = fall(*fresh, 0, 1000);
  });
  thread.join();
  EXPECT_TRUE(same(other, first));
}

TEST_P(Engine, ContinuesBitwiseFromASnapshotInTheMiddleOfAFallAndAfterIt) {
  const Scene scene = test::g1_scene();
  for (const int begin : {300, 900}) {
    const auto backend = make_backend(engine, scene);
    backend->reset(scene.robot->standing_state());
    backend->push(9, {3.0, 1.0, 0.0}, scene.robot->standing_state().X_WB.p);
    fall(*backend, 0, begin);
    ASSERT_FALSE(backend->contacts().empty());
    const Snapshot snapshot = backend->snapshot();
    const Trace first = fall(*backend, begin, begin + 600);
    backend->restore(snapshot);
    EXPECT_TRUE(same(fall(*backend, begin, begin + 600), first)) << begin;
    const auto fresh = make_backend(engine, scene);
    fresh->restore(snapshot);
    EXPECT_TRUE(same(fall(*fresh, begin, begin + 600), first)) << begin;
    EXPECT_EQ(fresh->time(), (begin + 600) * scene.dt);
  }
}

struct Old {
  double mass = 0.0;
  int link = 0;
};
struct Reordered {
  int link = 0;
  double mass = 0.0;
};
struct Longer {
  double mass = 0.0;
  int link = 0;
  std::string region;
};
struct Narrower {
  float mass = 0.0F;
  int link = 0;
};

template <typename T>
std::uint64_t layout_of() {
  Digest digest;
  digest.add_type(&T::mass, &T::link);
  return digest.value();
}

TEST(EngineInterface, ChangesWithTheOrderSizeAndNumberOfMembers) {
  EXPECT_EQ(layout_of<Old>(), layout_of<Old>());
  for (const std::uint64_t other : {layout_of<Reordered>(), layout_of<Longer>(), layout_of<Narrower>()})
    EXPECT_NE(layout_of<Old>(), other);
}

struct Interface {
  virtual ~Interface() = default;
  virtual void first() = 0;
};
struct WithOneMore : Interface {
  virtual void second() = 0;
};
struct AfterInterface : Interface {
  virtual void after() = 0;
};
struct AfterOneMore : WithOneMore {
  virtual void after() = 0;
};

TEST(EngineInterface, ChangesWithTheNumberOfVirtualFunctions) {
  EXPECT_EQ(Digest::first_word(&AfterOneMore::after) - Digest::first_word(&AfterInterface::after), sizeof(void*));
}

TEST(EngineInterface, IsOneNumberInOneProgram) { EXPECT_EQ(engine_interface(), EngineModule().interface); }

// The modules of this test stand in folders of their own.
TEST(EngineFolders, AModuleThatWasCompiledAgainstOtherTypesIsRefusedByOneSentence) {
  setenv("DUET_ENGINES", DUET_STRANGE_ENGINES ":" DUET_BUILT_ENGINES, 1);
  Scene scene;
  scene.robot = test::sledge();
  const std::string message = test::thrown_message<MissingError>([&] { make_backend("stranger", scene); });
  EXPECT_THAT(message, ::testing::MatchesRegex(
                           "engine 'stranger' is absent: .*/duet_stranger\\.so was compiled against other types "
                           "\\(interface [0-9a-f]{16}, duet [0-9.]+ has [0-9a-f]{16}\\): compile it again with the "
                           "headers and the compiler flags of this duet"));
  int strangers = 0, shipped = 0;
  for (const EngineInfo& info : engines()) {
    strangers += info.name == "stranger";
    shipped += info.available;
    EXPECT_FALSE(info.available && info.name == "stranger");
  }
  EXPECT_EQ(strangers, 1);
  if (shipped == 0) GTEST_SKIP() << "not run: engines absent";
}

TEST(Allocation, IsCounted) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: malloc belongs to the sanitizer";
  const long before = test::allocation_count();
  const auto value = std::make_unique<std::vector<double>>(10);
  EXPECT_GE(test::allocation_count(), before + 2);
}

// The allocations of an engine's own library, per step at most; our code adds none.
long allowed_per_step(const std::string& engine) {
  if (engine == "dart") return 2000;   // libdart's recursions and assertions
  if (engine == "ode") return 4;       // its memory grows with more contacts than were reserved for
  if (engine == "simbody") return 20;  // its State, where a stage is realised
  return 0;
}

TEST(Allocation, StepMakesNoneButWhatAnEnginesLibraryDoes) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: malloc belongs to the sanitizer";
  std::array<double, 24> bones{};
  bones.fill(0.2);
  for (const EngineInfo& info : engines()) {
    if (!info.available) continue;
    Scene scene = test::g1_scene(PartnerMode::kSolid);
    scene.human = make_human_body(bones);
    const auto backend = make_backend(info.name, scene);
    const RobotState state = scene.robot->standing_state();
    backend->reset(state);
    const JointCommand command = scene.robot->default_command(scene.robot->neutral);
    HumanJoints joints = HumanJoints::Constant(0.3);  // a pole before the robot
    joints.row(2).setLinSpaced(0.1, 1.3);
    const HumanJoints velocities = HumanJoints::Constant(0.01);
    backend->set_partner(joints, velocities);  // the first call after a reset checks the start
    const long before = test::allocation_count();
    constexpr int kSteps = 500;  // through the fall: contacts of every kind
    for (int i = 0; i < kSteps; ++i) {
      backend->set_partner(joints, velocities);
      backend->push(0, {1.0, 0.0, 0.0}, state.X_WB.p);
      backend->step(command);
    }
    EXPECT_LE(test::allocation_count() - before, kSteps * allowed_per_step(info.name)) << info.name;
  }
}

}  // namespace
}  // namespace duet
