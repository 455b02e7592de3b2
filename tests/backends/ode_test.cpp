// ODE: drift of its hinges, what it keeps per process and per thread, and its options. Laws of every engine are in
// engine_*_test.cpp.
#include <dlfcn.h>

#include <array>
#include <cmath>
#include <thread>

#include "duet/backends/engine_module.h"
#include "duet/robots/kinematics.h"
#include "tests/backends/contact_scene.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/backends/trace.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Ode : test::OnEngine<::testing::Test> {
  Ode() : OnEngine("ode") {}
};

// All joints swing by 0.6 rad, 1.5 times a second, on the ground: the pose of the sole that ODE's own contact point
// tells against the one that the joint angles tell.
TEST_F(Ode, HingesDriftLessThanAMillimetreInThrashing) {
  const Scene scene = test::g1_scene();
  const RobotModel& robot = *scene.robot;
  const auto backend = make_backend("ode", scene);
  backend->reset(robot.standing_state());
  JointCommand command = robot.default_command(robot.neutral);
  Kinematics kinematics(robot);
  RobotState before = backend->state();
  double drift = 0.0;
  int compared = 0;
  for (int i = 0; i < 1000; ++i) {
    for (int k = 0; k < robot.dof(); ++k)
      command.q_target[k] = robot.neutral[k] + 0.6 * std::sin(2.0 * M_PI * 1.5 * i * scene.dt + k);
    before = backend->state();
    ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_LT(backend->state().v.cwiseAbs().maxCoeff(), 60.0);
    kinematics.update(before.X_WB, before.q);
    for (const Contact& contact : backend->contacts()) {
      if (contact.side != ContactSide::kGround) continue;
      double nearest = 1.0;
      for (const RobotShape& shape : robot.shapes) {
        if (shape.link != contact.link || shape.kind != ShapeKind::kSphere) continue;
        const Eigen::Vector3d center = kinematics.p_WL(shape.link) + kinematics.R_WL(shape.link) * shape.X_LS.p;
        nearest = std::min(nearest, (center.head<2>() - contact.p_WC.head<2>()).norm());
      }
      if (nearest == 1.0) continue;
      drift = std::max(drift, nearest);
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
  EXPECT_LT(drift, 1e-3);
}

void append(test::Trace& to, const test::Trace& from) {
  to.states.insert(to.states.end(), from.states.begin(), from.states.end());
  to.contacts.insert(to.contacts.end(), from.contacts.begin(), from.contacts.end());
  to.forces.insert(to.forces.end(), from.forces.begin(), from.forces.end());
}

// ODE's data belong to a thread: a world made here must step, be restored and end there.
TEST_F(Ode, AWorldMayMoveToAnotherThread) {
  const Scene scene = test::g1_scene();
  auto backend = make_backend("ode", scene);
  backend->reset(scene.robot->standing_state());
  const test::Trace first = test::fall(*backend, 0, 50);
  test::Trace there;
  std::thread([&] {
    backend->reset(scene.robot->standing_state());
    there = test::fall(*backend, 0, 50);
  }).join();
  EXPECT_TRUE(same(there, first));
  std::thread([&] {
    backend->restore(backend->snapshot());
    there = test::fall(*backend, 50, 100);
    backend.reset();
  }).join();
  EXPECT_EQ(there.states.size(), 50U);
}

// Worlds without a threading implementation of their own share one list of jobs in the process and crash it.
TEST_F(Ode, ManyWorldsStepInSeveralThreadsAtOnce) {
  constexpr int kThreads = 4, kWorlds = 3, kSteps = 300;
  const Scene scene = test::g1_scene();
  const auto alone = make_backend("ode", scene);
  alone->reset(scene.robot->standing_state());
  const test::Trace expected = test::fall(*alone, 0, kSteps);
  std::array<std::array<test::Trace, kWorlds>, kThreads> found;
  std::vector<std::thread> threads;
  threads.reserve(kThreads);
  for (auto& traces : found)
    threads.emplace_back([&] {
      std::array<std::unique_ptr<Backend>, kWorlds> worlds;
      for (auto& world : worlds) {
        world = make_backend("ode", scene);
        world->reset(scene.robot->standing_state());
      }
      for (int i = 0; i < kSteps; ++i)
        for (int k = 0; k < kWorlds; ++k) append(traces[k], test::fall(*worlds[k], i, i + 1));
    });
  for (std::thread& thread : threads) thread.join();
  for (const auto& traces : found)
    for (const test::Trace& trace : traces) EXPECT_TRUE(same(trace, expected));
  EXPECT_GT(expected.forces.size(), static_cast<size_t>(kSteps));
}

TEST_F(Ode, RefusesOptionsThatItDoesNotHave) {
  Scene scene = test::g1_scene();
  scene.options = {{"contact_erpp", "0.2"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("ode", scene); }).find("contact_erp"),
            std::string::npos);
  scene.options = {{"friction", "cone"}};
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] { make_backend("ode", scene); }).find("friction"),
            std::string::npos);
}

TEST_F(Ode, OptionsReachTheEngine) {
  const auto depth = [](const EngineOptions& options) {
    Scene scene;
    scene.robot = test::sledge();
    scene.partner = PartnerMode::kNone;
    scene.options = options;
    const auto backend = make_backend("ode", scene);
    backend->reset(test::state_of(*scene.robot, {0.0, 0.0, 0.1}));
    for (int i = 0; i < 500; ++i) backend->step(test::no_torque(*scene.robot));
    return backend->contacts()[0].depth;
  };
  // At rest: erp depth / dt = cfm force.
  const double force = 10.0 * kGravity / 4.0;
  EXPECT_NEAR(depth({}), 1e-8 * force * 0.002 / 0.2, 1e-11);
  EXPECT_NEAR(depth({{"contact_cfm", "1e-4"}}), 1e-4 * force * 0.002 / 0.2, 1e-7);
  EXPECT_NEAR(depth({{"contact_cfm", "1e-4"}, {"contact_erp", "0.5"}}), 1e-4 * force * 0.002 / 0.5, 1e-7);
  EXPECT_NEAR(depth({{"contact_cfm", "1e-4"}, {"friction", "bounded"}}), 1e-4 * force * 0.002 / 0.2, 1e-7);
}

// By default ODE prints its errors and ends the process.
TEST_F(Ode, ErrorsOfTheLibraryBecomeExceptionsAndMessagesAreSilent) {
  const auto backend = make(test::sledge());  // the library is loaded and its handlers are set
  void* library = dlopen("libode.so.8", RTLD_LAZY | RTLD_NOLOAD);
  ASSERT_NE(library, nullptr);
  using Step = int (*)(void*, double);
  using Say = void (*)(int, const char*, ...);
  const auto step = reinterpret_cast<Step>(dlsym(library, "dWorldStep"));
  const auto say = reinterpret_cast<Say>(dlsym(library, "dMessage"));
  const auto fail = reinterpret_cast<Say>(dlsym(library, "dError"));
  ASSERT_TRUE(step != nullptr && say != nullptr && fail != nullptr);
  testing::internal::CaptureStderr();
  EXPECT_EQ(test::thrown_message<std::runtime_error>([&] { step(nullptr, 0.002); }).rfind("ode: ", 0), 0U);
  EXPECT_EQ(test::thrown_message<std::runtime_error>([&] { fail(7, "row %d", 3); }), "ode: row 3 (error 7)");
  say(1, "a complaint");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  dlclose(library);
}

struct OdeContact : test::ContactScene {
  OdeContact() : ContactScene("ode") {}
};

TEST_F(OdeContact, BoundedFrictionGivesTheSameForcesAsActive) {
  start(rest);
  backend->push(0, {20.0, 0.0, 0.0}, rest.X_WB.p);
  run(0.2);
  const std::vector<Contact> active(backend->contacts().begin(), backend->contacts().end());
  scene.options = {{"friction", "bounded"}};
  start(rest);
  backend->push(0, {20.0, 0.0, 0.0}, rest.X_WB.p);
  run(0.2);
  ASSERT_EQ(backend->contacts().size(), active.size());
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < active.size(); ++i) {
    EXPECT_NEAR(active[i].f_W.z(), backend->contacts()[i].f_W.z(), 0.01);
    a += active[i].f_W;
  }
  EXPECT_NEAR((a - test::force_of(*backend, ContactSide::kGround)).norm(), 0.0, 0.01);
}

}  // namespace
}  // namespace duet
