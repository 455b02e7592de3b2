// Descriptors of several networks: an encoder of a history and the policy that is shown its output.
#include "duet/controllers/composed_network.h"

#include <gmock/gmock.h>

#include "duet/controllers/audit/readings.h"
#include "duet/controllers/audit/self_consistency.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/backends/allocation_count.h"
#include "tests/controllers/fake_network.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::OnnxWriter;
using test::thrown_message;
using ::testing::ElementsAre;

constexpr int kFrame = 47, kFrames = 3, kHistory = kFrame * kFrames, kLatent = 5, kActions = 12;

OnnxWriter& encode(OnnxWriter& file, const std::string& shown) {
  file.constant("e", {kHistory, kLatent}, test::operand({kHistory, kLatent}, 1, 0.05).values);
  return file.node("MatMul", {shown, "e"}, {"sum"}).node("Tanh", {"sum"}, {"latent"});
}
OnnxWriter& act(OnnxWriter& file, const std::string& shown) {
  file.constant("p", {kFrame + kLatent, kActions}, test::operand({kFrame + kLatent, kActions}, 2, 0.05).values);
  return file.node("MatMul", {shown, "p"}, {"actions"}).output("actions");
}

// rl_gym's descriptor with these lines in the place of its network and of its inputs.
std::string descriptor(const std::string& networks, const std::string& inputs) {
  std::string text = read_file(std::string(DUET_SOURCE_DIR) + "/controllers/descriptors/rl_gym.yaml");
  const auto replace = [&](const std::string& from, const std::string& to, const std::string& with) {
    const std::size_t begin = text.find(from), end = text.find(to, begin);
    text.replace(begin, end - begin, with);
  };
  replace("network:", "rate_hz:", networks);
  replace("inputs:", "# Its training", "inputs:\n" + inputs + "action: {output: actions}\n");
  return text;
}

constexpr const char* kHistoryParts = "parts: [{groups: [frame], frames: 3, start: repeated}]";

struct ComposedNetworkTest : ::testing::Test {
  ComposedNetworkTest() {
    OnnxWriter encoder, policy, whole;
    write_file(folder / "encoder.onnx",
               encode(encoder.input("history", {1, kHistory}), "history").output("latent").bytes());
    write_file(folder / "policy.onnx", act(policy.input("obs", {1, kFrame + kLatent}), "obs").bytes());
    encode(whole.input("history", {1, kHistory}).input("obs", {1, kFrame}), "history");
    whole.node("Concat", {"obs", "latent"}, {"both"}, {{"axis", std::int64_t{1}}});
    write_file(folder / "whole.onnx", act(whole, "both").bytes());
    write("whole", "network: whole.onnx\n",
          std::string("  - {name: history, ") + kHistoryParts +
              "}\n"
              "  - {name: obs, parts: [{groups: [frame]}]}\n");
    write_two("{from: encoder.latent, size: 5}");
  }
  void write(const std::string& name, const std::string& networks, const std::string& inputs) const {
    write_file(folder / (name + ".yaml"), descriptor(networks, inputs));
  }
  void write_two(const std::string& part, const std::string& of_encoder = kHistoryParts) const {
    write(
        "two", "network: policy.onnx\nnetworks:\n  - {name: encoder, file: encoder.onnx}\n",
        "  - {name: encoder.history, " + of_encoder + "}\n  - {name: obs, parts: [{groups: [frame]}, " + part + "]}\n");
  }
  [[nodiscard]] std::unique_ptr<Controller> controller(const std::string& name) const {
    return make_controller(folder / (name + ".yaml"), robot);
  }
  [[nodiscard]] std::string refusal() const {
    std::string message = thrown_message<InputError>([&] { static_cast<void>(controller("two")); });
    for (std::size_t at = message.find(folder / ""); at != std::string::npos; at = message.find(folder / ""))
      message.erase(at, (folder / "").size());
    return message;
  }

  test::ScratchFolder folder;
  std::shared_ptr<const RobotModel> robot = test::body("g1_12dof");
};

// A movement in which no number stays as it is.
RobotState state_at(const RobotModel& robot, int tick) {
  RobotState state = robot.standing_state();
  for (int j = 0; j < robot.dof(); ++j) {
    state.q[j] += 0.1 * std::sin(0.3 * tick + j);
    state.v[j] = std::cos(0.2 * tick + j);
  }
  state.w_WB_B = {0.1 * tick, 0.2, -0.05 * tick};
  return state;
}

TEST_F(ComposedNetworkTest, CommandsWhatTheOneNetworkOfBothDoes) {
  const auto two = controller("two"), whole = controller("whole");
  JointCommand mine = robot->default_command(robot->neutral), theirs = mine;
  for (int episode = 0; episode < 2; ++episode) {
    two->reset(state_at(*robot, 0));
    whole->reset(state_at(*robot, 0));
    for (int tick = 0; tick < 10; ++tick) {
      const RobotState state = state_at(*robot, tick);
      two->act(state, {state.X_WB, state.q}, mine);
      whole->act(state, {state.X_WB, state.q}, theirs);
      ASSERT_EQ(mine.q_target, theirs.q_target) << tick;
    }
    EXPECT_GT((mine.q_target - robot->neutral).norm(), 1e-3);
  }
}

TEST_F(ComposedNetworkTest, AllocatesNothingInAct) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer counts";
  const auto two = controller("two");
  const RobotState state = state_at(*robot, 1);
  JointCommand command = robot->default_command(robot->neutral);
  two->reset(state);
  const Reference reference{state.X_WB, state.q};
  two->act(state, reference, command);
  const long before = test::allocation_count();
  two->act(state, reference, command);
  EXPECT_EQ(test::allocation_count(), before);
}

TEST_F(ComposedNetworkTest, EachOfItsFilesIsNamed) {
  std::vector<std::string> roles;
  for (const LoadedFile& file : controller_files(folder / "two.yaml")) roles.push_back(file.role);
  EXPECT_THAT(roles, ElementsAre("descriptor", "network", "encoder network"));
}

TEST_F(ComposedNetworkTest, EveryOtherReadingOfItStillFits) {
  const Descriptor two = read_descriptor(folder / "two.yaml");
  const NetworkFile network = load_networks(two);
  const auto make = controllers_of_network(robot, network.make, "policy.onnx");
  for (const Reading& reading : other_readings(two, *robot))
    EXPECT_NO_THROW(make(reading.descriptor, {})) << reading.said;
}

TEST_F(ComposedNetworkTest, WhatDoesNotFitIsRefused) {
  write_two("{from: encoder.latent, size: 6}");
  EXPECT_SENTENCE(refusal());
  write_two("{from: encoder.latents, size: 5}");
  EXPECT_SENTENCE(refusal());
  write_two("{from: teacher.latent, size: 5}");
  EXPECT_SENTENCE(refusal());
  write_two("{from: encoder.latent, size: 0}");
  EXPECT_SENTENCE(refusal());
  write_two("{from: encoder.latent, size: 5, frames: 2}");
  EXPECT_SENTENCE(refusal());
  write_two("{groups: [frame], size: 5}");
  EXPECT_SENTENCE(refusal());
  write_two("{from: encoder.latent, size: 5}",
            "parts: [{groups: [frame], frames: 2}, {from: encoder.latent, size: 5}]");
  EXPECT_SENTENCE(refusal());
  write("two", "network: policy.onnx\nnetworks:\n  - {name: a, file: encoder.onnx}\n  - {name: a, file: b.onnx}\n", "");
  EXPECT_SENTENCE(refusal());
}

TEST_F(ComposedNetworkTest, AnAbsentNetworkIsNamed) {
  std::filesystem::remove(folder / "encoder.onnx");
  EXPECT_THAT(thrown_message<MissingError>([&] { static_cast<void>(controller("two")); }),
              testing::HasSubstr("no network 'encoder' of the controller 'rl_gym'"));
}

}  // namespace
}  // namespace duet
