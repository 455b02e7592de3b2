
#include "duet/core/require.h"
#include "duet/hardware/guard/robot_connection.h"
#include "tests/support.h"

namespace duet {
namespace {

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

TEST(RobotConfig, AWordOfExecutorOdometryAndCameraIsTaken) {
  const std::string more =
      "executor: homie-lcm\nodometry: legs\nlcm: {interface: eth1, port: 7668, hops: 1, group: 239.255.76.68}\n"
      "camera: {position: [0.1, 0, 0.5], quat_wxyz: [0.5, -0.5, 0.5, -0.5]}\n";
  const RobotConfig config = parse_robot_config(kTwin + more, "twin.yaml");
  EXPECT_EQ(config.executor, ExecutorKind::kHomieLcm);
  EXPECT_EQ(config.odometry, OdometrySource::kLegs);
  EXPECT_EQ(config.lcm.interface, "eth1");
  EXPECT_EQ(config.lcm.port, 7668);
  EXPECT_EQ(config.lcm.hops, 1);
  EXPECT_EQ(config.lcm.group, "239.255.76.68");
  ASSERT_TRUE(config.has_camera);
  EXPECT_EQ(config.camera.X_BC.p.z(), 0.5);
  EXPECT_LE((config.camera.X_BC.R * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 1e-12);  // looks ahead
  const GuardSetup setup = guard_setup(config, false);
  EXPECT_TRUE(setup.rules.executor_answers && setup.has_battery);
  EXPECT_FALSE(guard_setup(config, true).rules.executor_answers);
}

TEST(RobotConfig, ANetworkIsAnAddressAndAKey) {
  EXPECT_FALSE(parse_robot_config(kTwin, "twin.yaml").has_network);
  const RobotConfig config =
      parse_robot_config(std::string(kTwin) + "network: {bind: 127.0.0.1:15100, key: guard.key}\n", "twin.yaml");
  EXPECT_TRUE(config.has_network);
  EXPECT_EQ(config.network.bind, "127.0.0.1:15100");
  EXPECT_EQ(config.network.key, "guard.key");
  for (const char* text : {"{bind: 127.0.0.1, key: guard.key}", "{bind: 127.0.0.1:15100}", "{key: guard.key}",
                           "{bind: 127.0.0.1:15100, key: guard.key, port: 3}", "3"})
    EXPECT_SENTENCE(test::thrown_message<InputError>(
        [&] { (void)parse_robot_config(std::string(kTwin) + "network: " + text + "\n", "twin.yaml"); }));
}

TEST(RobotConfig, ARobotHasNoOdometryUntilItIsNamed) {
  const RobotConfig robot =
      parse_robot_config("schema: duet.robot/1\nrobot: x\ninterface: eth0\ndomain: 0\nmode_machine: 5\n", "robot.yaml");
  EXPECT_EQ(robot.odometry, OdometrySource::kNone);
  EXPECT_EQ(parse_robot_config(kTwin, "twin.yaml").odometry, OdometrySource::kTwin);
}

TEST(RobotConfig, OfTheExamplesAreTwins) {
  for (const char* name : {"homie", "sport", "camera", "lowcmd", "vendor_arm"}) {
    const RobotConfig config = read_robot_config(std::string(DUET_SOURCE_DIR) + "/examples/hardware/" + name + ".yaml");
    EXPECT_TRUE(config.twin) << name;
    EXPECT_EQ(executor_refusal(config.executor, config.odometry, true), "") << name;
  }
}

std::string refusal_of_more(const std::string& more) {
  return test::thrown_message<InputError>([&] { (void)parse_robot_config(kTwin + more, "twin.yaml"); });
}

TEST(RobotConfig, NamesWhatIsWrongWithExecutorAndCamera) {
  EXPECT_SENTENCE(refusal("domain: 150", "domain: 150.5"));
  EXPECT_SENTENCE(refusal("mode_machine: 5", "mode_machine: 1e300"));
  for (const char* text :
       {"executor: vendor-arm-action\n", "arm_action: hug\n", "executor: vendor-arm-action\narm_action: hugs\n",
        "executor: homie\n", "odometry: gps\n", "lcm: {port: 70000}\n", "lcm: {hops: 0.5}\n",
        "camera: {position: [0, 0, 3], quat_wxyz: [1, 0, 0, 0]}\n",
        "camera: {position: [0, 0, 1], quat_wxyz: [1, 0, 0]}\n",
        "camera: {position: [0, 0, 1], quat_wxyz: [1, 1, 0, 0]}\n",
        "camera: {position: [0, 0, 1], quat_wxyz: [1, x, 0, 0]}\n",
        "camera: {position: [0, 0, 1], quat_wxyz: [.nan, 0, 0, 0]}\n"})
    EXPECT_SENTENCE(refusal_of_more(text));
}

// The maker's arm actions pass no limiter: nobody may be near, and no joint counts as executed.
TEST(RobotConfig, AnArmActionIsAloneAndExecutesNoJoint) {
  const RobotConfig config =
      parse_robot_config(kTwin + std::string("executor: vendor-arm-action\narm_action: shake hand\n"), "twin.yaml");
  const GuardSetup setup = guard_setup(config, false);
  EXPECT_TRUE(setup.limiter.executed.joints.empty());
  EXPECT_TRUE(setup.rules.executor_answers);
  const ExecutedChannels channels =
      executed_channels(config.executor, *setup.limiter.robot, setup.limiter.executed.joints);
  EXPECT_EQ(std::ranges::count(channels.executed, true), 4);
  EXPECT_SENTENCE(executed_channels_text(channels, *setup.limiter.robot));
  std::string near = kTwin + std::string("executor: vendor-arm-action\narm_action: shake hand\n");
  near.replace(near.find("person: false"), 13, "person: true");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)parse_robot_config(near, "twin.yaml"); }));
}

TEST(RobotConfig, NamesWhatIsWrong) {
  EXPECT_SENTENCE(refusal("duet.robot/1", "duet.robot/2"));
  EXPECT_SENTENCE(refusal("domain: 150", "domain: 0"));
  EXPECT_SENTENCE(refusal("interface: lo", "interface: auto"));
  EXPECT_SENTENCE(refusal("forward: 0.1", "forward: 0.3"));
  EXPECT_SENTENCE(refusal("forward: 0.1", "forwards: 0.1"));
  EXPECT_SENTENCE(refusal("[hand, hand]", "hand"));
  EXPECT_SENTENCE(refusal("person: false", "people: false"));
}

}  // namespace
}  // namespace duet
