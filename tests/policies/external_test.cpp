#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "duet/core/require.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/external/message.h"
#include "tests/deep_json.h"
#include "tests/policies/external_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using nlohmann::json;
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

std::string refusal_of_message(const std::string& text) {
  return thrown_message<InputError>([&] { parse_policy_message(text); });
}

TEST(PolicyMessage, IsReadAsItWasMeant) {
  EXPECT_EQ(parse_policy_message(R"({"type":"ready"})").type, PolicyMessage::Type::kReady);
  const PolicyMessage hello = parse_policy_message(R"({"type":"hello","version":1,"joints":["a","b"]})");
  EXPECT_EQ(hello.type, PolicyMessage::Type::kHello);
  EXPECT_EQ(hello.version, 1);
  EXPECT_EQ(hello.joints, (std::vector<std::string>{"a", "b"}));
  const PolicyMessage plan = parse_policy_message(R"({"type":"plan","tick":30,"anchors":[[1,2.5],[3,4]]})");
  EXPECT_EQ(plan.type, PolicyMessage::Type::kPlan);
  EXPECT_EQ(plan.tick, 30);
  EXPECT_EQ(plan.anchors, 2);
  EXPECT_EQ(plan.numbers, (std::vector<float>{1.0F, 2.5F, 3.0F, 4.0F}));
}

TEST(PolicyMessage, RefusesWhatIsNone) {
  for (const char* text :
       {"[1]", "{}", R"({"type":1})", R"({"type":"plam"})", R"({"type":"ready","now":1})", R"({"type":"hello"})",
        R"({"type":"hello","version":"1"})", R"({"type":"hello","version":-1})",
        R"({"type":"hello","version":1,"joints":[1]})", R"({"type":"plan","tick":1,"anchors":1})",
        R"({"type":"plan","tick":1,"anchors":[1]})", R"({"type":"plan","tick":1,"anchors":[[null]]})",
        R"({"type":"plan","tick":1e3,"anchors":[]})", R"({"type":"plan","tick":1,"anchors":[[-Infinity]]})"})
    EXPECT_SENTENCE(refusal_of_message(text));
}

// 800 kB are below the limit of a message; the message of a value that deep once ended the program.
TEST(PolicyMessage, RefusesWhatNestsWithoutEnd) {
  const std::string expected = std::string("message of the policy: ") + test::kTooDeep;
  EXPECT_EQ(refusal_of_message(R"({"type":"plan","tick":)" + test::deep_json() + R"(,"anchors":[]})"), expected);
  EXPECT_EQ(refusal_of_message(R"({"type":"plan","tick":1,"anchors":)" + test::deep_json() + "}"), expected);
  EXPECT_EQ(refusal_of_message(R"({"type":"hello","version":)" + test::deep_json() + "}"), expected);
}

TEST(PolicyMessage, SaysWhatIsWrongWithTextThatIsNoJson) {
  EXPECT_SENTENCE(refusal_of_message(R"({"type":"plan","tick":1e999,"anchors":[]})"));
  EXPECT_LT(refusal_of_message("\"" + std::string(400'000, 'x')).size(), 300U);
  EXPECT_SENTENCE(refusal_of_message(R"({"type":")" + std::string(400'000, 'x') + "\"}"));
}

TEST(PolicyMessage, BuffersCutAStreamAtAnyPlace) {
  const std::vector<std::string> messages = {"first", "", std::string(70000, 'x'), "last"};
  std::string stream;
  for (const std::string& message : messages) stream += framed(message);
  for (const std::size_t step : {std::size_t{1}, std::size_t{3}, std::size_t{4096}, stream.size()}) {
    MessageBuffer buffer;
    std::vector<std::string> found;
    for (std::size_t at = 0; at < stream.size(); at += step) {
      buffer.append(std::string_view(stream).substr(at, step));
      while (std::optional<std::string> message = buffer.next()) found.push_back(std::move(*message));
    }
    EXPECT_EQ(found, messages) << step;
  }
}

TEST(PolicyMessage, BuffersRefuseALengthThatIsNone) {
  MessageBuffer buffer;
  buffer.append(std::string_view("\x01\x00\x10\x00", 4));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { buffer.next(); }));
}

TEST(PolicyMessage, DuetSpeaksJson) {
  const json observe = json::parse(observe_message(20, {1.0F, 0.1F, -2e-8F, 3.0F}, 2));
  EXPECT_EQ(observe["tick"], 20);
  ASSERT_EQ(observe["frames"].size(), 2U);
  EXPECT_EQ(observe["frames"][0][1].get<float>(), 0.1F);
  EXPECT_EQ(observe["frames"][1][0].get<float>(), -2e-8F);
  EpisodeContext context = test::episode(test::g1()->standing_state());
  context.prompt = "say \"hello\" \xff";  // not UTF-8
  EXPECT_THAT(json::parse(reset_message(context))["prompt"].get<std::string>(), HasSubstr("say \"hello\""));
  EXPECT_EQ(json::parse(bye_message())["type"], "bye");
  const json hello = json::parse(hello_message({}, *test::g1(), test::g1()->joint_names()));
  EXPECT_EQ(hello["tasks"], json(task_names(kPaperTasks)));
  const json last = hello["channels"].back();
  EXPECT_EQ(last["name"], "root_orientation");
  EXPECT_EQ(last["first"].get<int>() + last["size"].get<int>(), kObservationSize);
}

// The answer that came while this process was stopped is there when it goes on.
TEST(PolicySocket, TimeInWhichTheProcessWasStoppedIsNotWaitedFor) {
  const SocketPair pair = connected_pair();
  MessageSocket socket(pair.ours);
  double now = 0.0;
  int looks = 0;
  AwakeDeadline stopped(std::chrono::milliseconds(1), AwakeTime([&] {
                          if (++looks == 3) {
                            EXPECT_EQ(write(pair.theirs, "\0\0\0\0", 4), 4);
                          }
                          return now += 180.0;
                        }));
  std::string message;
  EXPECT_EQ(socket.receive(message, stopped), MessageSocket::Result::kDone);
  AwakeDeadline silent(std::chrono::milliseconds(1), AwakeTime([&] { return now += 0.5; }));
  EXPECT_EQ(socket.receive(message, silent), MessageSocket::Result::kLate);
  close(pair.theirs);
}

// "host:port" is TCP; with a slash it is a path, colons and all.
TEST(PolicySocket, APathMayHaveAColon) {
  const test::ScratchFolder folder;
  const std::string path = folder / "a:1";
  const int listener = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(path.size(), sizeof(address.sun_path));
  path.copy(address.sun_path, path.size());
  ASSERT_EQ(bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(listener, 1), 0);
  AwakeDeadline deadline(std::chrono::seconds(5));
  const int connected = connect_to(path, deadline);
  EXPECT_GE(connected, 0);
  close(connected);
  close(listener);
}

}  // namespace
}  // namespace duet
