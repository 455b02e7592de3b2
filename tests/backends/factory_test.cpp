#include <gmock/gmock.h>

#include <algorithm>
#include <set>
#include <span>

#include "duet/backends/engine_module.h"
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

}  // namespace
}  // namespace duet
