
#include "duet/core/require.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/descriptor.h"
#include "tests/policies/external_fixtures.h"

namespace duet {
namespace {

using test::replaced;
using test::thrown_message;

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
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "duet.policy/1", "duet.policy/2")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "kind: onnx", "kind: onxx")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "network:", "netwrok:")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "[a, b]", "[a, a]")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "joints: [a, b]\n", "")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "partner_root", "partner_roof")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "[1, 2]", "[1, 2, 3]")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "[1, 2]", "[1, .nan]")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "frames: 12", "frames: 13")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "partner_root", "language")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "{channel: noise, size: 180}", "noise")));
  EXPECT_SENTENCE(refusal(replaced(kNetwork, "spacing: 0.1", "spacing: 0.11")));
  EXPECT_SENTENCE(refusal(kNetwork + "command: [python3]\n"));
  EXPECT_SENTENCE(refusal(kProcess + "network: mine.onnx\n"));
  EXPECT_SENTENCE(refusal(kProcess + "socket: here\n"));
  EXPECT_SENTENCE(refusal(replaced(kProcess, "command: [python3, mine.py]\n", "")));
  EXPECT_SENTENCE(refusal(kProcess + "deadline_ms: 0\n"));
  EXPECT_SENTENCE(refusal(kProcess + "hang_ms: 1.5\n"));
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

  for (const std::string text : {"tasks: [wafe]\n", "tasks: [wave, wave]\n", "tasks: []\n"})
    EXPECT_SENTENCE(refusal(kProcess + text));
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
  EXPECT_SENTENCE(thrown_message<InputError>([&] { bind_joints(descriptor, *test::g1()); }));
  descriptor.joints.erase(descriptor.joints.begin());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { bind_joints(descriptor, *test::g1()); }));
}

TEST(PolicyDescriptor, OfTheExamplesIsReadable) {
  const std::string folder = std::string(DUET_SOURCE_DIR) + "/examples/policies/";
  EXPECT_EQ(read_policy_descriptor(folder + "wave_policy.yaml").name, "wave_policy");
  const PolicyDescriptor network = read_policy_descriptor(folder + "onnx_policy.yaml");
  EXPECT_EQ(bind_joints(network, *test::g1()).size(), 29U);
}

}  // namespace
}  // namespace duet
