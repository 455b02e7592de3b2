#include <gmock/gmock.h>

#include <algorithm>
#include <set>
#include <span>

#include "duet/backends/engine_module.h"
#include "duet/backends/narrow_phase.h"
#include "duet/core/require.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;

Scene sledge_scene() {
  Scene scene;
  scene.robot = test::sledge();
  return scene;
}

TEST(Factory, ListsEachEngineOnceWithVersionOrReason) {
  std::vector<std::string> names;
  for (const EngineInfo& info : engines()) {
    names.push_back(info.name);
    EXPECT_EQ(info.available, !info.version.empty()) << info.name;
    EXPECT_EQ(info.available, info.reason.empty()) << info.name;
  }
  const std::vector<std::string> benchmark = {"mujoco", "bullet", "ode", "simbody", "dart"};
  ASSERT_GE(names.size(), benchmark.size());
  EXPECT_TRUE(std::ranges::equal(benchmark, std::span(names).first(benchmark.size())));  // then other modules by name
  EXPECT_TRUE(std::ranges::is_sorted(std::span(names).subspan(benchmark.size())));
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
}

TEST(Factory, MakesWhatItListsAsAvailableAndRefusesTheRestByName) {
  for (const EngineInfo& info : engines()) {
    if (info.available) {
      const std::unique_ptr<Backend> backend = make_backend(info.name, sledge_scene());
      EXPECT_EQ(backend->name(), info.name);
      EXPECT_EQ(backend->version(), info.version);
    } else {
      EXPECT_THAT(thrown_message<MissingError>([&] { make_backend(info.name, sledge_scene()); }), HasSubstr(info.name));
    }
  }
}

TEST(Factory, RefusesAnUnknownEngineWithTheNearestName) {
  const std::string message = thrown_message<std::invalid_argument>([] { make_backend("mujocco", sledge_scene()); });
  EXPECT_THAT(message, HasSubstr("unknown engine 'mujocco'"));
  EXPECT_THAT(message, HasSubstr("'mujoco'"));
  EXPECT_THAT(message, HasSubstr("simbody"));
}

// But one in a host, whose cost is not this thread's.
TEST(Factory, EveryEngineThatIsThereHasABareLoop) {
  const Scene scene = sledge_scene();
  const RobotState state = test::state_of(*scene.robot, {0.0, 0.0, 0.1});
  const JointCommand command = test::no_torque(*scene.robot);
  for (const EngineInfo& info : engines()) {
    if (!info.available) continue;
    const EngineModule& module = engine_module(info.name);
    if (module.absence != nullptr) continue;
    EXPECT_GT(module.bare_step_seconds(scene, state, command, 100), 0.0) << info.name;
    EXPECT_THAT(thrown_message<std::invalid_argument>([&] { module.bare_step_seconds(scene, state, command, 0); }),
                HasSubstr("steps is 0"))
        << info.name;
  }
}

TEST(Factory, RefusesAnOptionThatTheEngineDoesNotHave) {
  for (const EngineInfo& info : engines()) {
    if (!info.available) continue;
    Scene scene = sledge_scene();
    scene.options["itterations"] = "10";
    EXPECT_THAT(thrown_message<std::invalid_argument>([&] { make_backend(info.name, scene); }),
                HasSubstr("'itterations'"));
  }
}

// A start with bodies inside one another is refused by name, in every engine through Backend's own calls.

// The wheel with a sphere of 0.1 m on its base and one on its rim, the rim's `apart` m to the side.
Scene two_spheres(double apart) {
  auto robot = test::wheel();
  for (const int link : {0, 1}) {
    RobotShape shape;
    shape.link = link;
    shape.X_LS.p.x() = link * apart;
    shape.radius = 0.1;
    shape.region = "ball";
    robot->shapes.push_back(shape);
  }
  robot->self_collision = {{0, 1}};
  Scene scene;
  scene.robot = robot;
  scene.human.capsules = {{.name = "left_hand", .region = "hand", .joint_a = 20, .joint_b = 22, .radius = 0.08}};
  scene.partner = PartnerMode::kSolid;
  return scene;
}

RobotState at_height(const Scene& scene, double z) { return test::state_of(*scene.robot, {0.0, 0.0, z}); }

std::string robot_message(const Scene& scene, double z) {
  return thrown_message<std::invalid_argument>([&] { refuse_robot_overlap(scene, at_height(scene, z)); });
}

HumanJoints hand_at(const Eigen::Vector3d& p_W) {
  HumanJoints joints = HumanJoints::Zero();
  joints.colwise() += p_W;
  return joints;
}

TEST(StartOverlap, NamesTheLinksOfAPairAndTheDepth) {
  EXPECT_EQ(robot_message(two_spheres(0.15), 1.0), "Backend::reset: base and rim overlap by 0.050 m");
  EXPECT_NO_THROW(refuse_robot_overlap(two_spheres(0.171), at_height(two_spheres(0.171), 1.0)));
  Scene untouched = two_spheres(0.15);
  untouched.self_collision = false;
  EXPECT_NO_THROW(refuse_robot_overlap(untouched, at_height(untouched, 1.0)));
}

TEST(StartOverlap, NamesTheLinkBelowTheGroundAndItsDepth) {
  EXPECT_EQ(robot_message(two_spheres(0.3), 0.06), "Backend::reset: base is 0.040 m below the ground");
  EXPECT_NO_THROW(refuse_robot_overlap(two_spheres(0.3), at_height(two_spheres(0.3), 0.071)));
}

TEST(StartOverlap, NamesThePartOfThePartnerAndTheLink) {
  const Scene scene = two_spheres(0.3);
  const RobotState state = at_height(scene, 1.0);
  const auto message = [&](double x) {
    return thrown_message<std::invalid_argument>([&] { refuse_partner_overlap(scene, state, hand_at({x, 0.0, 1.0})); });
  };
  EXPECT_EQ(message(0.36), "Backend::set_partner: left_hand (region hand) of the partner and rim overlap by 0.120 m");
  EXPECT_NO_THROW(refuse_partner_overlap(scene, state, hand_at({0.39, 0.0, 1.0})));
  Scene ghost = scene;
  ghost.partner = PartnerMode::kGhost;
  EXPECT_NO_THROW(refuse_partner_overlap(ghost, state, hand_at({0.3, 0.0, 1.0})));
}

TEST(StartOverlap, EveryEngineRefusesItAndGoesOnAfterAGoodStart) {
  for (const EngineInfo& engine : engines()) {
    if (!engine.available) continue;
    const Scene scene = two_spheres(0.3);
    const auto backend = make_backend(engine.name, scene);
    EXPECT_THROW(backend->reset(at_height(scene, 0.0)), std::invalid_argument) << engine.name;
    backend->reset(at_height(scene, 1.0));
    EXPECT_THROW(backend->set_partner(hand_at({0.3, 0.0, 1.0}), HumanJoints::Zero()), std::invalid_argument)
        << engine.name;
    backend->set_partner(hand_at({0.5, 0.0, 1.0}), HumanJoints::Zero());
    // The partner may move in later: only the start is checked.
    backend->set_partner(hand_at({0.36, 0.0, 1.0}), HumanJoints::Zero());
    EXPECT_EQ(backend->step(test::no_torque(*scene.robot)), Outcome::kOk) << engine.name;
  }
}

}  // namespace
}  // namespace duet
