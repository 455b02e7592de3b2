// The form that somebody fills in before a robot is armed: what is missing, stale or of something else.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <string>

#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/log/log_reader.h"
#include "duet/hardware/log/run_report.h"
#include "duet/hardware/safety/checklist.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kNow = 1795860900.0;  // 2026-11-28T10:15Z [s]
const std::string kConfigDigest(64, 'a'), kCardDigest(64, 'b');

std::string with(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

std::string filled() {
  std::string text = empty_checklist("E21-1", kConfigDigest, kCardDigest, kNow);
  text = with(text, "who: \"\"", "who: A. Name");
  const char* values[] = {"B. Name", "", "5", "12", "stood 0.1 s, then fell into the rope", "10", "", "41.5"};
  const std::vector<std::string> names = checklist_names();
  for (std::size_t k = 0; k < kChecklistItems; ++k) {
    const std::string value = values[k];
    text = with(text, names[k] + (value.empty() ? ": {done: no}" : ": {done: no, value: \"\"}"),
                names[k] + (value.empty() ? ": {done: yes}" : ": {done: yes, value: \"" + value + "\"}"));
  }
  return text;
}

std::string refusal_of(const std::string& text) {
  return test::thrown_message<InputError>([&] { (void)parse_checklist(text, "form.yaml"); });
}

TEST(Checklist, IsReadAsItWasFilledIn) {
  const Checklist form = parse_checklist(filled(), "form.yaml");
  EXPECT_EQ(form.robot, "E21-1");
  EXPECT_EQ(form.who, "A. Name");
  EXPECT_EQ(form.when, "2026-11-28T10:15Z");
  EXPECT_EQ(form.at, kNow);
  EXPECT_EQ(form.configuration, kConfigDigest);
  for (const ChecklistAnswer& answer : form.answers) EXPECT_TRUE(answer.done);
  EXPECT_EQ(form.answers[3].value, "12");
  EXPECT_EQ(checklist_json(form)["items"][7]["value"], "41.5");
  EXPECT_EQ(checklist_refusal(form, {"form.yaml"}, "E21-1", kConfigDigest, kCardDigest, kNow + 60.0), "");
}

TEST(Checklist, AnEmptyOneSaysWhatIsToBeFilledIn) {
  const std::string empty = empty_checklist("E21-1", kConfigDigest, kCardDigest, kNow);
  EXPECT_SENTENCE(refusal_of(empty));
  const Checklist form = parse_checklist(with(empty, "who: \"\"", "who: A. Name"), "form.yaml");
  EXPECT_SENTENCE(checklist_refusal(form, {"form.yaml"}, "E21-1", kConfigDigest, kCardDigest, kNow));
}

TEST(Checklist, NamesWhatIsWrong) {
  const std::string good = filled();
  for (const auto& [from, to] : std::initializer_list<std::pair<const char*, const char*>>{
           {"  feet: {done: yes}\n", ""},
           {"feet:", "foot:"},
           {"items:", "item:"},
           {"duet.checklist/1", "duet.checklist/2"},
           {"when: 2026-11-28T10:15Z", "when: 28.11.2026"},
           {"when: 2026-11-28T10:15Z", "when: 2026-02-30T10:15Z"},
           {"when: 2026-11-28T10:15Z", "when: 2026-11-28T24:15Z"},
           {"value: \"12\"", "value: \"9\""},
           {"value: \"12\"", "value: ten"},
           {"value: \"12\"", "value: nan"},
           {"{done: yes, value: \"12\"}", "{done: yes}"},
           {"{done: yes, value: \"12\"}", "{done: perhaps}"},
           {"{done: yes, value: \"12\"}", "yes"},
           {"twin: {done: yes}", "twin: {done: yes, value: 3}"},
           {"twin: {done: yes}", "twin: {done: no}"}})
    EXPECT_SENTENCE(refusal_of(with(good, from, to)));
}

TEST(Checklist, IsOneRobotsForOneConfigurationAndGrowsOld) {
  const Checklist form = parse_checklist(filled(), "form.yaml");
  const ChecklistDemand demand{"form.yaml", 12.0};
  const std::string other(64, 'c');
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-2", kConfigDigest, kCardDigest, kNow));
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", other, kCardDigest, kNow));
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, other, kNow));
  EXPECT_EQ(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow + 12 * 3600.0), "");
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow + 12.1 * 3600.0));
  EXPECT_EQ(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow - 300.0), "");
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow - 3600.0));
}

TEST(Checklist, WhatComesAfterTheLastItemThatIsAskedForMayBeOpen) {
  const std::string text =
      with(with(filled(), "feet: {done: yes}", "feet: {done: no}"), "dummy: {done: yes", "dummy: {done: no");
  const Checklist form = parse_checklist(text, "form.yaml");
  ChecklistDemand demand{"form.yaml"};
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow));
  demand.up_to = "stops";
  EXPECT_EQ(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow), "");
}

TEST(Checklist, AConfigurationSaysWhetherItIsNeeded) {
  const auto config = [](const std::string& checklist) {
    return parse_robot_config(
               "schema: duet.robot/1\nrobot: twin\ntwin: true\ninterface: lo\ndomain: 150\n"
               "mode_machine: 5\nchecklist: " +
                   checklist + "\n",
               "twin.yaml")
        .checklist;
  };
  EXPECT_EQ(config("{form: a.yaml}").hours, 12.0);
  EXPECT_FALSE(config("{form: a.yaml}").required);
  const ChecklistDemand demand = config("{form: a.yaml, hours: 8, up_to: stops, required: true}");
  EXPECT_TRUE(demand.required && demand.hours == 8.0 && demand.up_to == "stops" && demand.form == "a.yaml");
  for (const char* text : {"{hours: 8}", "{form: a.yaml, hours: 0}", "{form: a.yaml, up_to: end}", "a.yaml"})
    EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)config(text); }));
}

TEST(Checklist, IsKeptWithTheLog) {
  const test::ScratchFolder folder;
  GuardSetup setup = test::twin_guard();
  setup.checklist = dumped(checklist_json(parse_checklist(filled(), "form.yaml")));
  {
    test::GuardedTwin robot(setup);
    RunLog log(folder / "run.mcap", setup);
    robot.tick();
    log.add(robot.guard);
  }
  const RunReport report = report_of_log(folder / "run.mcap");
  EXPECT_EQ(report.checked_by, "A. Name");
  EXPECT_EQ(report.checked_when, "2026-11-28T10:15Z");
  ASSERT_EQ(report.checks.size(), kChecklistItems);
  EXPECT_EQ(report.checks[5].name, "stops");
  EXPECT_EQ(report.checks[5].value, "10");
  EXPECT_TRUE(report.checks[5].done);
}

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
    const RobotConfig config = read_robot_config(fmt::format("{}/examples/hardware/{}.yaml", DUET_SOURCE_DIR, name));
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
