#include "duet/backends/engine_module.h"
#include "tests/backends/allocation_count.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

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
