#include "backends/factory.h"

#include <gmock/gmock.h>

#include "backends/mujoco/bare_loop.h"
#include "core/require.h"
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
  EXPECT_EQ(names, (std::vector<std::string>{"playback", "mujoco"}));
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
  EXPECT_THAT(message, HasSubstr("playback"));
}

TEST(Factory, BareLoopRunsWhereMujocoIsAndIsRefusedWhereItIsNot) {
  const Scene scene = sledge_scene();
  const RobotState state = test::state_of(*scene.robot, {0.0, 0.0, 0.1});
  const JointCommand command = test::no_torque(*scene.robot);
  if (!engines()[1].available) {
    EXPECT_THAT(thrown_message<MissingError>([&] { mujoco_bare_step_seconds(scene, state, command, 10); }),
                HasSubstr("MuJoCo"));
    return;
  }
  EXPECT_GT(mujoco_bare_step_seconds(scene, state, command, 100), 0.0);
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] { mujoco_bare_step_seconds(scene, state, command, 0); }),
              HasSubstr("steps is 0"));
}

}  // namespace
}  // namespace duet
