#include <gmock/gmock.h>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "tests/backends/g1_scene.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

TEST(Controllers, AreMadeByNameAndKnowTheirs) {
  EXPECT_THAT(controller_names(), ::testing::IsSupersetOf({"pd", "vmc"}));
  for (const std::string name : {"pd", "vmc"}) {
    const auto controller = make_controller(name, test::g1());
    EXPECT_EQ(controller->name(), name);
    EXPECT_FALSE(controller_info(std::string(controller->name())).walks);
  }
}

TEST(Controllers, AreDescribedInOneLineEach) {
  const std::vector<ControllerInfo> infos = controllers();
  ASSERT_EQ(infos.size(), controller_names().size());
  for (size_t i = 0; i < infos.size(); ++i) {
    EXPECT_EQ(infos[i].name, controller_names()[i]);
    EXPECT_FALSE(infos[i].about.empty());
    EXPECT_EQ(infos[i].about.find('\n'), std::string::npos);
    EXPECT_EQ(infos[i].robot.empty(), infos[i].name == "pd" || infos[i].name == "vmc") << infos[i].name;  // any robot
  }
}

TEST(Controllers, RefuseAnUnknownNameAndNoRobot) {
  const std::string message = thrown_message<std::invalid_argument>([] { make_controller("vcm", test::g1()); });
  EXPECT_SENTENCE(message);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_controller("pd", nullptr); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_controller("pd", test::g1(), {{"gain", "2"}}); }));
}

TEST(Pd, IsTheCardsGainsAroundTheReference) {
  const auto robot = test::g1();
  const auto pd = make_controller("pd", robot);
  const RobotState state = robot->standing_state();
  pd->reset(state);
  Reference reference{state.X_WB, robot->neutral};
  reference.q[3] += 0.1;
  JointCommand command;
  pd->act(state, reference, command);
  const JointCommand expected = robot->default_command(reference.q);
  EXPECT_EQ(command.q_target, expected.q_target);
  EXPECT_EQ(command.kp, expected.kp);
  EXPECT_EQ(command.kd, expected.kd);
  EXPECT_EQ(command.tau_ff, expected.tau_ff);
}

// 2 x 40 N m/rad at the ankles hold less than m g h = 210 N m/rad: a fact of the gains, not a fault.
TEST(Pd, FallsWithinOneToTwoSeconds) {
  if (!engines()[0].available) GTEST_SKIP() << "not run: " << engines()[0].reason;
  const Scene scene = test::g1_scene();
  const auto backend = make_backend("mujoco", scene);
  backend->reset(scene.robot->standing_state());
  const JointCommand command = scene.robot->default_command(scene.robot->neutral);
  while (backend->time() < 5.0 && backend->state().X_WB.p.z() > 0.45) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_GT(backend->time(), 0.8);
  EXPECT_LT(backend->time(), 2.0);
}

}  // namespace
}  // namespace duet
