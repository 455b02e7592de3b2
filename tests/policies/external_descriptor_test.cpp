#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/descriptor.h"
#include "tests/policies/external_fixtures.h"

namespace duet {
namespace {

using test::replaced;
using test::thrown_message;
using ::testing::HasSubstr;

const std::string kNetwork = R"(schema: duet.policy/1
name: mine
about: a test
kind: onnx
network: mine.onnx
joints: [a, b]
frame_of_reference: ego
inputs:
  - name: obs
    frames: 12
    order: newest_first
    channels: [partner_root, {channel: joint_positions, offset: [1, 2], scale: 0.5}]
  - {name: x_T, channels: [{channel: noise, size: 180}]}
output: {name: plan, anchors: 3, spacing: 0.1, frame: displacement, joints_from: neutral, scale: 2.0}
)";

const std::string kProcess = R"(schema: duet.policy/1
name: mine
about: a test
kind: process
command: [python3, mine.py]
)";

std::string refusal(const std::string& text) {
  return thrown_message<InputError>([&] { parse_policy_descriptor(text, "mine.yaml"); });
}

TEST(PolicyDescriptor, SaysWhatANetworkIsShownAndWhatItsOutputMeans) {
  const PolicyDescriptor read = parse_policy_descriptor(kNetwork, "folder/mine.yaml");
  EXPECT_EQ(read.kind, PolicyKind::kOnnx);
  EXPECT_EQ(read.folder(), "folder");
  EXPECT_EQ(read.frame, PolicyFrame::kEgo);
  ASSERT_EQ(read.inputs.size(), 2U);
  EXPECT_EQ(read.inputs[0].frames, 12);
  EXPECT_TRUE(read.inputs[0].newest_first);
  EXPECT_EQ(read.inputs[0].channels[1].kind, ChannelKind::kJointAngle);
  EXPECT_EQ(read.inputs[0].channels[1].shift, (std::vector<double>{1, 2}));
  EXPECT_EQ(read.inputs[1].channels[0].size, 180);
  EXPECT_EQ(read.output.anchors, 3);
  EXPECT_EQ(read.output.ticks_per_anchor, 5);
  EXPECT_EQ(read.output.frame, PlanFrame::kDisplacement);
  EXPECT_TRUE(read.output.joints_from_neutral);
}

TEST(PolicyDescriptor, OfAProcessHasDefaults) {
  const PolicyDescriptor read = parse_policy_descriptor(kProcess, "mine.yaml");
  EXPECT_EQ(read.kind, PolicyKind::kProcess);
  EXPECT_EQ(read.command, (std::vector<std::string>{"python3", "mine.py"}));
  EXPECT_EQ(read.folder(), ".");
  EXPECT_EQ(read.deadline_ms, 0);  // none: a slow machine changes no result
  EXPECT_EQ(read.hang_ms, 60000);
  EXPECT_EQ(read.start_ms, 120000);
  EXPECT_EQ(read.output.anchors, kAnchors);
  EXPECT_EQ(read.output.ticks_per_anchor, 25);
  EXPECT_EQ(read.output.frame, PlanFrame::kWorld);
}

TEST(PolicyDescriptor, RefusesWhatItDoesNotUnderstand) {
  EXPECT_EQ(refusal(replaced(kNetwork, "duet.policy/1", "duet.policy/2")),
            "mine.yaml:1: policy descriptor: 'schema': expected 'duet.policy/1', found 'duet.policy/2'");
  EXPECT_THAT(refusal(replaced(kNetwork, "kind: onnx", "kind: onxx")),
              HasSubstr("mine.yaml:4: policy descriptor: unknown kind 'onxx': did you mean 'onnx'?"));
  EXPECT_THAT(refusal(replaced(kNetwork, "network:", "netwrok:")), HasSubstr("did you mean 'network'?"));
  EXPECT_EQ(refusal(replaced(kNetwork, "[a, b]", "[a, a]")),
            "mine.yaml:6: policy descriptor: 'joints': expected each joint once, found 'a' again");
  EXPECT_EQ(refusal(replaced(kNetwork, "joints: [a, b]\n", "")),
            "mine.yaml:1: policy descriptor: 'joints': expected the joints in the network's order, found none");
  EXPECT_THAT(refusal(replaced(kNetwork, "partner_root", "partner_roof")),
              HasSubstr("mine.yaml:12: input: unknown channel 'partner_roof': did you mean 'partner_root'?"));
  EXPECT_EQ(refusal(replaced(kNetwork, "[1, 2]", "[1, 2, 3]")),
            "mine.yaml:12: channel: 'offset': expected 1 or 2 numbers, found 3");
  EXPECT_EQ(refusal(replaced(kNetwork, "[1, 2]", "[1, .nan]")),
            "mine.yaml:12: channel: 'offset': expected finite numbers, found '.nan'");
  EXPECT_EQ(refusal(replaced(kNetwork, "frames: 12", "frames: 13")),
            "mine.yaml:10: input: 'frames': expected a whole number in [1, 12], found 13");
  EXPECT_EQ(refusal(replaced(kNetwork, "partner_root", "language")),
            "mine.yaml:12: input: channel 'language': expected in an input of 1 frame, found in one of 12");
  EXPECT_EQ(refusal(replaced(kNetwork, "{channel: noise, size: 180}", "noise")),
            "mine.yaml:13: input: channel 'noise': expected {channel: noise, size: NUMBER}, found no size");
  EXPECT_EQ(refusal(replaced(kNetwork, "spacing: 0.1", "spacing: 0.11")),
            "mine.yaml:14: output: 'spacing': expected a multiple of 0.02 s in [0.02, 10], found 0.11");
  EXPECT_EQ(refusal(kNetwork + "command: [python3]\n"),
            "mine.yaml:15: policy descriptor: expected no key 'command' where 'kind' is 'onnx', found one");
  EXPECT_EQ(refusal(kProcess + "network: mine.onnx\n"),
            "mine.yaml:6: policy descriptor: expected no key 'network' where 'kind' is 'process', found one");
  EXPECT_EQ(refusal(kProcess + "socket: here\n"),
            "mine.yaml:5: policy descriptor: expected one of 'command' and 'socket', found both");
  EXPECT_EQ(refusal(replaced(kProcess, "command: [python3, mine.py]\n", "")),
            "mine.yaml:1: policy descriptor: expected one of 'command' and 'socket', found none");
  EXPECT_EQ(refusal(kProcess + "deadline_ms: 0\n"),
            "mine.yaml:6: policy descriptor: 'deadline_ms': expected a whole number in [1, 600000], found 0");
  EXPECT_EQ(refusal(kProcess + "hang_ms: 1.5\n"),
            "mine.yaml:6: policy descriptor: 'hang_ms': expected a whole number in [1, 600000], found 1.5");
}

// A descriptor that was made before there was a seventh task keeps its six numbers.
TEST(PolicyDescriptor, KnowsTheSixTasksOfTheSupplementUnlessItSaysOthers) {
  const PolicyDescriptor six = parse_policy_descriptor(replaced(kNetwork, "noise, size: 180", "task"), "mine.yaml");
  EXPECT_EQ(six.tasks, std::vector<Task>(kPaperTasks.begin(), kPaperTasks.end()));
  EXPECT_EQ(channel_size(six.inputs[1].channels[0], {.joints = 2, .actions = 0}), 6);
  const PolicyDescriptor two = parse_policy_descriptor(
      replaced(kNetwork, "noise, size: 180", "task") + "tasks: [wave, high-five]\n", "mine.yaml");
  EXPECT_EQ(two.tasks, (std::vector<Task>{Task::kWave, Task::kHighFive}));
  EXPECT_EQ(channel_size(two.inputs[1].channels[0], {.joints = 2, .actions = 0}), 2);

  EXPECT_THAT(refusal(kProcess + "tasks: [wafe]\n"),
              HasSubstr("mine.yaml:6: policy descriptor: 'tasks': unknown task 'wafe': did you mean 'wave'?"));
  EXPECT_EQ(refusal(kProcess + "tasks: [wave, wave]\n"),
            "mine.yaml:6: policy descriptor: 'tasks': expected each task once, found 'wave' again");
  EXPECT_EQ(refusal(kProcess + "tasks: []\n"),
            "mine.yaml:6: policy descriptor: 'tasks': expected at least one task, found none");
}

TEST(PolicyDescriptor, JointsAreThoseOfTheRobotInAnyOrder) {
  PolicyDescriptor descriptor = parse_policy_descriptor(kProcess, "mine.yaml");
  std::vector<int> identity(29);
  for (int i = 0; i < 29; ++i) identity[i] = i;
  EXPECT_EQ(bind_joints(descriptor, *test::g1()), identity);
  descriptor.joints = test::g1()->joint_names();
  std::swap(descriptor.joints[3], descriptor.joints[20]);
  std::swap(identity[3], identity[20]);
  EXPECT_EQ(bind_joints(descriptor, *test::g1()), identity);
  descriptor.joints_line = 6;
  descriptor.joints[0] = "tail_joint";
  EXPECT_THAT(thrown_message<InputError>([&] { bind_joints(descriptor, *test::g1()); }),
              HasSubstr("mine.yaml:6: 'joints' with robot 'g1': unknown joint 'tail_joint'"));
  descriptor.joints.erase(descriptor.joints.begin());
  EXPECT_EQ(thrown_message<InputError>([&] { bind_joints(descriptor, *test::g1()); }),
            "mine.yaml:6: 'joints' with robot 'g1': expected its 29 joints, found none 'left_hip_pitch_joint'");
}

TEST(PolicyDescriptor, OfTheExamplesIsReadable) {
  const std::string folder = std::string(DUET_SOURCE_DIR) + "/examples/policies/";
  EXPECT_EQ(read_policy_descriptor(folder + "wave_policy.yaml").name, "wave_policy");
  const PolicyDescriptor network = read_policy_descriptor(folder + "onnx_policy.yaml");
  EXPECT_EQ(bind_joints(network, *test::g1()).size(), 29U);
}

}  // namespace
}  // namespace duet
