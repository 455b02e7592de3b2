// Engines in processes of their own: what duet sends, and what it says of a host that dies, lies or is late. The host
// is a script of Python, fake_host.py.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "duet/backends/engine_module.h"
#include "duet/backends/host/host_backend.h"
#include "duet/backends/node/node_engine.h"
#include "duet/core/child_process.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/robot_cards.h"
#include "tests/backends/engine_fixture.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/backends/trace.h"
#include "tests/support.h"

namespace duet {
namespace {

using std::chrono::milliseconds;
using test::thrown_message;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// Processes that this one has started and not reaped.
int children() {
  int count = 0;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream list(thread.path() / "children");
    for (int pid = 0; list >> pid;) ++count;
  }
  return count;
}

bool has_python() {
  try {
    return !find_program("python3", ".").empty();
  } catch (const MissingError&) {
    return false;
  }
}

class Host : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_python()) GTEST_SKIP() << "not run: python3 absent";
  }
  static HostProgram program(const std::string& fault, int step = 3) {
    return {.engine = "fake",
            .version = "1",
            .command = {"python3", "fake_host.py", fault, std::to_string(step)},
            .folder = DUET_BACKENDS_TESTS};
  }
  static std::unique_ptr<Backend> make(const std::string& fault, int step = 3) {
    return make_host_backend(scene(), program(fault, step));
  }
  static Scene scene() {
    Scene scene;
    scene.robot = test::wheel();
    scene.partner = PartnerMode::kNone;
    return scene;
  }
  static void step(Backend& backend, int times = 1) {
    for (int i = 0; i < times; ++i) backend.step(test::no_torque(*backend.scene().robot));
  }
  // The message of the fourth step at the latest.
  static std::string said(const HostProgram& program) {
    return thrown_message<std::runtime_error>([&] {
      const auto backend = make_host_backend(scene(), program);
      backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1.0}));
      step(*backend, 4);
    });
  }
};

TEST_F(Host, GetsTheSceneAndAnswersSteps) {
  const auto backend = make("none");
  EXPECT_EQ(backend->name(), "fake");
  EXPECT_EQ(backend->version(), "1");
  RobotState state = test::state_of(*backend->scene().robot, {0.0, 0.5, 1.0});
  state.q[0] = 0.25;
  backend->reset(state);
  step(*backend, 2);
  EXPECT_EQ(backend->state().q[0], 0.25);
  EXPECT_EQ(backend->state().X_WB.p.y(), 0.5);
  EXPECT_TRUE(backend->contacts().empty());
}

TEST_F(Host, KicksAndSnapshotsAreDuets) {
  const auto backend = make("none");
  backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1.0}));
  step(*backend);
  const Snapshot one = backend->snapshot();
  backend->kick({0.5, 0.0, 0.0});
  step(*backend, 3);
  EXPECT_EQ(backend->state().v_WB.x(), 0.5);
  EXPECT_EQ(backend->snapshot().values.back(), 4.0);  // the memory came back with each step
  backend->restore(one);
  step(*backend);
  EXPECT_EQ(backend->state().v_WB.x(), 0.0);
  EXPECT_EQ(backend->snapshot().values.back(), 2.0);
  backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1.0}));
  EXPECT_EQ(backend->snapshot().values.back(), 0.0);
}

TEST_F(Host, ServesOneWorldAfterTheOther) {
  const auto process = [](const Backend& backend) { return *(backend.snapshot().values.end() - 2); };
  const int before = children();
  double first = 0.0;
  for (int world = 0; world < 3; ++world) {
    const auto backend = make("reused");
    step(*backend);
    if (world == 0) first = process(*backend);
    EXPECT_EQ(process(*backend), first) << world;
  }
  const auto one = make("reused"), other = make("reused");  // two at once
  step(*one);
  step(*other);
  EXPECT_EQ(process(*one), first);
  EXPECT_NE(process(*other), first);
  EXPECT_LE(children(), before + 2);
}

TEST_F(Host, OneThatEndsWhileItWaitsIsReplaced) {
  int first = 0;
  {
    const auto backend = make("waits");
    step(*backend);
    first = static_cast<int>(*(backend->snapshot().values.end() - 2));
  }
  kill(first, SIGKILL);
  while (kill(first, 0) == 0) usleep(1000);  // until it has been reaped
  const auto backend = make("waits");
  step(*backend);
  EXPECT_NE(static_cast<int>(*(backend->snapshot().values.end() - 2)), first);
}

struct Fault {
  const char* name;
  const char* message;
};

TEST_F(Host, EveryFaultIsOneSentenceAndLeavesNoProcess) {
  constexpr std::array kFaults = {
      Fault{"exit", "its host ended with exit status 7 before it answered message 4"},
      Fault{"kill", "its host ended with signal 9 (Killed) before it answered message 4"},
      Fault{"close", "its host closed the connection before it answered message 4"},
      Fault{"short", "its host answers message 4 with 152 bytes, expected 160 to 240"},
      Fault{"long", "its host answers message 4 with 1048736 bytes, expected 160 to 240"},
      Fault{"odd", "its host answers a step with 163 bytes, which are no whole number of doubles"},
      Fault{"echo", "its host answers message 5, expected 4"},
      Fault{"kind", "its host answers with a frame of kind 9, expected 2 or 3"},
      Fault{"say", "its solver met a wall"},
      Fault{"nan", "number 5 of its host's answer at 0.0040 s is not finite"},
      Fault{"infinite", "is not finite"},
      Fault{"outcome", "has the outcome 2, expected 0 or 1 (diverged)"},
      Fault{"norm", "quaternion in its host's answer has norm"},
      Fault{"count", "its host's answer says 1 contacts and has 20 numbers"},
      Fault{"link", "the link of a contact in its host's answer is 77, expected a whole number from 0 to 1"},
      Fault{"side", "the side of a contact in its host's answer is 77, expected a whole number from 0 to 2"},
      Fault{"other", "the other side of a contact in its host's answer is 77"},
      Fault{"refuse", "this scene has a link named \\x1b[31mred"},
      Fault{"protocol", "does not answer the scene as duet.host/1 has it: protocol: expected \"duet.host/1\""},
      Fault{"engine", "engine: expected \"fake\", found \"another\""},
      Fault{"version", "version: expected \"1\", found \"another\""},
      Fault{"memory", "memory: expected a whole number from 0 to 65536, found -1"},
      Fault{"contacts", "contacts: expected a whole number from 0 to 4096, found 1.5"},
      Fault{"key", "unknown key 'speed'"},
      Fault{"json", "its answer to the scene"},
  };
  const int before = children();
  for (const Fault& fault : kFaults) {
    EXPECT_THAT(said(program(fault.name)), AllOf(StartsWith("fake: "), HasSubstr(fault.message))) << fault.name;
    EXPECT_EQ(children(), before) << fault.name;
  }
}

TEST_F(Host, OneThatIsLateIsGivenUp) {
  for (const char* fault : {"late", "stall"}) {
    HostProgram slow = program(fault);
    slow.hang = milliseconds(300);
    const int before = children();
    EXPECT_EQ(said(slow), "fake: its host gave no answer to message 4 within 300 ms") << fault;
    EXPECT_EQ(children(), before) << fault;
  }
}

TEST_F(Host, AfterAFaultEveryStepSaysThatItHasEnded) {
  const auto backend = make("exit");
  EXPECT_THAT(thrown_message<std::runtime_error>([&] { step(*backend, 4); }), HasSubstr("exit status 7"));
  EXPECT_EQ(thrown_message<std::runtime_error>([&] { step(*backend); }), "fake: its host has ended");
}

TEST_F(Host, DivergenceIsAnOutcomeAndNoFault) {
  for (const char* fault : {"diverge", "speed"}) {
    const auto backend = make(fault, 1);
    const JointCommand command = test::no_torque(*backend->scene().robot);
    EXPECT_EQ(backend->step(command), Outcome::kDiverged) << fault;
    EXPECT_EQ(backend->step(command), Outcome::kDiverged) << fault;
    backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 1.0}));
  }
}

TEST_F(Host, AProgramThatIsNotThereIsMissing) {
  HostProgram absent = program("none");
  absent.command = {"no-such-program"};
  EXPECT_THAT(thrown_message<MissingError>([&] { make_host_backend(scene(), absent); }),
              HasSubstr("cannot run 'no-such-program'"));
}

TEST_F(Host, TheSceneHasTheOptionsThatHold) {
  const std::vector<EngineOption> options = {integer_option("iterations", 20, 1, 100, "at most"),
                                             choice_option("cone", {"elliptic", "pyramidal"}, "of friction")};
  Scene scene = Host::scene();
  scene.options = {{"cone", "pyramidal"}};
  const nlohmann::json json = host_scene(scene, options);
  EXPECT_EQ(json.at("options"), (nlohmann::json{{"iterations", 20.0}, {"cone", "pyramidal"}}));
  EXPECT_EQ(json.at("robot").at("joints").size(), 1U);
  EXPECT_EQ(json.at("robot").at("links").at(0).at("parent"), -1);
  EXPECT_EQ(json.at("partner"), "none");
  EXPECT_TRUE(json.at("capsules").empty());
}

// The engines of Node.js, where their packages are.

class HostedEngine : public test::OnEngine<::testing::TestWithParam<std::string>> {
 protected:
  HostedEngine() : OnEngine(GetParam()) {}
};
INSTANTIATE_TEST_SUITE_P(Engines, HostedEngine, ::testing::Values("mujoco3", "physx"), test::engine_of);

// The G1 falls over, and with it contacts of feet, knees and hands come and go.
TEST_P(HostedEngine, ContinuesBitForBitFromASnapshotInContactInAnyProcess) {
  const auto one = make_backend(engine, test::g1_scene()), other = make_backend(engine, test::g1_scene());
  const RobotModel& robot = *one->scene().robot;
  one->reset(test::state_of(robot, {0.0, 0.0, robot.standing_height}));
  test::fall(*one, 0, 400);
  EXPECT_FALSE(one->contacts().empty());
  one->push(7, {20.0, 0.0, 5.0}, one->state().X_WB.p);
  one->kick({0.2, 0.1, 0.0});
  const Snapshot snapshot = one->snapshot();
  const test::Trace first = test::fall(*one, 400, 700);
  one->restore(snapshot);
  EXPECT_TRUE(test::same(first, test::fall(*one, 400, 700)));
  other->restore(snapshot);
  EXPECT_TRUE(test::same(first, test::fall(*other, 400, 700)));
}

TEST_P(HostedEngine, TheGroundCarriesTheWeightAndForcesActOnTheLink) {
  const auto backend = make_backend(engine, [] {
    Scene scene;
    scene.robot = test::sledge();
    scene.partner = PartnerMode::kNone;
    return scene;
  }());
  backend->reset(test::state_of(*backend->scene().robot, {0.0, 0.0, 0.1}));
  for (int i = 0; i < 500; ++i) backend->step(test::no_torque(*backend->scene().robot));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  ASSERT_EQ(backend->contacts().size(), 4U);
  for (const Contact& contact : backend->contacts()) {
    sum += contact.f_W;
    EXPECT_EQ(contact.link, 0);
    EXPECT_EQ(contact.side, ContactSide::kGround);
    EXPECT_NEAR(contact.p_WC.z(), -0.5 * contact.depth, 1e-6);  // in the middle of the overlap
  }
  EXPECT_NEAR(sum.z(), 10.0 * kGravity, 0.05);
  EXPECT_LT(sum.head<2>().norm(), 0.05);
}

// Packages of npm: what is missing is one sentence, before any world is made.

class NodeEngineTest : public ::testing::Test {
 protected:
  NodeEngineTest() { setenv("DUET_HOSTS", (folder_ / ".").c_str(), 1); }
  ~NodeEngineTest() override { unsetenv("DUET_HOSTS"); }
  NodeEngineTest(const NodeEngineTest&) = delete;
  NodeEngineTest& operator=(const NodeEngineTest&) = delete;
  void install(const std::string& package_json) const {
    std::filesystem::create_directories(folder_ / "node_modules/@some/engine");
    write_file(folder_ / "node_modules/@some/engine/package.json", package_json);
  }
  const NodeEngine engine_ = {
      .engine = "some", .package = "@some/engine", .package_version = "1.2.3", .engine_version = "1"};
  test::ScratchFolder folder_;
};

TEST_F(NodeEngineTest, SaysWhatIsMissingAndHowToGetIt) {
  EXPECT_EQ(absence_of(engine_),
            "the package @some/engine 1.2.3 of npm is not there: `./run setup --engines some` installs it");
}

TEST_F(NodeEngineTest, AnotherVersionIsRefused) {
  install(R"({"name": "@some/engine", "version": "1.2.4"})");
  EXPECT_THAT(absence_of(engine_), HasSubstr("has @some/engine 1.2.4, expected 1.2.3: `./run setup --engines some`"));
  install("{}");
  EXPECT_THAT(absence_of(engine_), HasSubstr("package.json: no version"));
  install("{");
  EXPECT_THAT(absence_of(engine_), HasSubstr("package.json"));
}

TEST_F(NodeEngineTest, AnOldNodeIsRefused) {
  install(R"({"version": "1.2.3"})");
  const std::string node = folder_ / "node", path = std::getenv("PATH");
  write_file(node, "#!/bin/sh\necho v16.20.1\n");
  std::filesystem::permissions(node, std::filesystem::perms::owner_all);
  setenv("PATH", (folder_ / ".").c_str(), 1);
  EXPECT_THAT(absence_of(engine_), HasSubstr("node is Node.js 'v16.20.1', expected 18 or later"));
  write_file(node, "#!/bin/sh\necho v20.1.0\n");
  EXPECT_EQ(absence_of(engine_), "");
  std::filesystem::remove(node);
  EXPECT_EQ(absence_of(engine_), "Node.js is not there (Debian's package nodejs)");
  setenv("PATH", path.c_str(), 1);
}

}  // namespace
}  // namespace duet
