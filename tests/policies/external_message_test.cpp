#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "duet/core/require.h"
#include "duet/policies/external/message.h"
#include "tests/deep_json.h"
#include "tests/policies/external_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using nlohmann::json;
using test::thrown_message;
using ::testing::HasSubstr;

std::string refusal(const std::string& text) {
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
    EXPECT_SENTENCE(refusal(text));
}

// 800 kB are below the limit of a message; the message of a value that deep once ended the program.
TEST(PolicyMessage, RefusesWhatNestsWithoutEnd) {
  const std::string expected = std::string("message of the policy: ") + test::kTooDeep;
  EXPECT_EQ(refusal(R"({"type":"plan","tick":)" + test::deep_json() + R"(,"anchors":[]})"), expected);
  EXPECT_EQ(refusal(R"({"type":"plan","tick":1,"anchors":)" + test::deep_json() + "}"), expected);
  EXPECT_EQ(refusal(R"({"type":"hello","version":)" + test::deep_json() + "}"), expected);
}

TEST(PolicyMessage, SaysWhatIsWrongWithTextThatIsNoJson) {
  EXPECT_SENTENCE(refusal(R"({"type":"plan","tick":1e999,"anchors":[]})"));
  EXPECT_LT(refusal("\"" + std::string(400'000, 'x')).size(), 300U);
  EXPECT_SENTENCE(refusal(R"({"type":")" + std::string(400'000, 'x') + "\"}"));
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
