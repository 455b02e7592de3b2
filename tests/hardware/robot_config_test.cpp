#include "duet/hardware/robot_config.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

constexpr const char* kTwin =
    "schema: duet.robot/1\n"
    "robot: twin\n"
    "twin: true\n"
    "interface: lo\n"
    "domain: 150\n"
    "mode_machine: 5\n"
    "allow_motion: true\n"
    "person: false\n"
    "limits: {forward: 0.1}\n"
    "touches: [[hand, hand], [hand, forearm]]\n";

std::string refusal(const std::string& from, const std::string& to) {
  std::string text = kTwin;
  text.replace(text.find(from), from.size(), to);
  return test::thrown_message<InputError>([&] { (void)parse_robot_config(text, "twin.yaml"); });
}

TEST(RobotConfig, IsReadWhole) {
  const RobotConfig config = parse_robot_config(kTwin, "twin.yaml");
  EXPECT_TRUE(config.twin && config.permission.allow_motion);
  EXPECT_FALSE(config.person);
  EXPECT_EQ(config.permission.domain, 150);
  EXPECT_EQ(config.limits.forward, 0.1);
  EXPECT_EQ(config.limits.backward, HardwareLimits{}.backward);
  EXPECT_EQ(config.touches.size(), 2u);
}

TEST(RobotConfig, OfTheExampleIsATwins) {
  const RobotConfig config = read_robot_config(std::string(DUET_SOURCE_DIR) + "/examples/hardware/twin.yaml");
  EXPECT_TRUE(config.twin);
  EXPECT_EQ(guard_setup(config, true).limiter.executed.joints.size(), 14u);
}

TEST(RobotConfig, WithoutAWordMotionIsNotAllowedAndSomebodyIsNear) {
  const RobotConfig config =
      parse_robot_config("schema: duet.robot/1\nrobot: x\ninterface: eth0\ndomain: 0\nmode_machine: 5\n", "robot.yaml");
  EXPECT_FALSE(config.permission.allow_motion);
  EXPECT_TRUE(config.person);
  EXPECT_FALSE(config.twin);
}

TEST(RobotConfig, NamesWhatIsWrong) {
  EXPECT_THAT(refusal("duet.robot/1", "duet.robot/2"), HasSubstr("twin.yaml:1: robot: 'schema': expected"));
  EXPECT_THAT(refusal("domain: 150", "domain: 0"), HasSubstr("twin: expected a domain from 100 to 199 on 'lo'"));
  EXPECT_THAT(refusal("interface: lo", "interface: auto"), HasSubstr("expected the name of one (not 'auto')"));
  EXPECT_THAT(refusal("forward: 0.1", "forward: 0.3"), HasSubstr("forward: expected"));
  EXPECT_THAT(refusal("forward: 0.1", "forwards: 0.1"), HasSubstr("forwards"));
  EXPECT_THAT(refusal("[hand, hand]", "hand"), HasSubstr("expected [part of the robot, part of a person]"));
  EXPECT_THAT(refusal("person: false", "people: false"), HasSubstr("people"));
}

}  // namespace
}  // namespace duet
