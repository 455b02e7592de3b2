#include "duet/controllers/wbc_sim/wbc_sim.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/controllers/standing.h"
#include "tests/deep_json.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::standing_reference;

// A network of random weights that does little: enough for all but the quality.
WbcNetwork small_network(WbcKind kind) {
  const WbcLayout layout(g1()->dof());
  const int inputs = layout.size(kind);
  Random random(5, 6);
  WbcNetwork network;
  network.kind = kind;
  network.robot = g1()->name;
  network.joints = g1()->joint_names();
  network.mlp = random_mlp({inputs, 16, g1()->dof()}, 0.1F, random);
  network.mean.setZero(inputs);
  network.deviation.setOnes(inputs);
  network.action_scale.setConstant(g1()->dof(), 0.25);
  network.neutral = g1()->neutral;
  const JointCommand command = g1()->default_command(g1()->neutral);
  network.kp = command.kp;
  network.kd = command.kd;
  network.note = "test";
  return network;
}

std::string temporary(const std::string& name) {
  return (std::filesystem::temp_directory_path() / ("duet-wbc-" + name + ".safetensors")).string();
}

TEST(WbcNetwork, IsTheSameAfterSavingAndLoading) {
  const std::string path = temporary("round-trip");
  for (const TensorType type : {TensorType::kF32, TensorType::kF16}) {
    const WbcNetwork network = small_network(WbcKind::kStudent);
    save_wbc_network(path, network, type);
    const WbcNetwork read = load_wbc_network(path, *g1());
    EXPECT_EQ(read.kind, WbcKind::kStudent);
    EXPECT_LT((read.mlp.layers[0].W - network.mlp.layers[0].W).cwiseAbs().maxCoeff(),
              type == TensorType::kF32 ? 0.0F + 1e-9F : 1e-3F);
    EXPECT_LT((read.kp - network.kp).cwiseAbs().maxCoeff(), 0.1);
  }
  std::filesystem::remove(path);
}

TEST(WbcNetwork, KeepsTheGaitItWasMadeWith) {
  const std::string path = temporary("gait");
  WbcNetwork network = small_network(WbcKind::kStudent);
  network.gait = {.frequency = 1.6,
                  .swing_height = 0.07,
                  .max_speed = 1.0,
                  .start_distance = 0.1,
                  .lead_time = 0.4,
                  .capture_time = 0.27};
  save_wbc_network(path, network, TensorType::kF32);
  const GaitOptions read = load_wbc_network(path, *g1()).gait;
  EXPECT_EQ(read.frequency, 1.6);
  EXPECT_EQ(read.swing_height, 0.07);
  EXPECT_EQ(read.max_speed, 1.0);
  EXPECT_EQ(read.start_distance, 0.1);
  EXPECT_EQ(read.lead_time, 0.4);
  EXPECT_EQ(read.capture_time, 0.27);
  SafeTensors older = read_safetensors(path);
  older.metadata.erase("gait");
  write_safetensors(path, older);
  EXPECT_EQ(load_wbc_network(path, *g1()).gait.max_speed, 0.6);
  EXPECT_EQ(load_wbc_network(path, *g1()).gait.lead_time, 0.0);
  EXPECT_EQ(load_wbc_network(path, *g1()).gait.capture_time, 0.0);
  std::filesystem::remove(path);
}

// Each edit of a good file, and what the message must say.
TEST(WbcNetwork, BadFilesAreRefusedByWhatIsWrong) {
  const std::string path = temporary("bad");
  save_wbc_network(path, small_network(WbcKind::kOracle), TensorType::kF32);
  const SafeTensors good = read_safetensors(path);
  const auto refused = [&](const std::function<void(SafeTensors&)>& edit) {
    SafeTensors bad = good;
    edit(bad);
    write_safetensors(path, bad);
    EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_wbc_network(path, *g1()); }));
  };
  refused([](SafeTensors& t) { t.metadata.erase("format"); });
  refused([](SafeTensors& t) { t.metadata["robot"] = "h1"; });
  refused([](SafeTensors& t) { t.metadata["joints"] = R"(["a", "b"])"; });
  refused([](SafeTensors& t) { t.metadata["joints"].replace(t.metadata["joints"].find("left_knee"), 9, "left_elbo"); });
  refused([](SafeTensors& t) { t.metadata["observation"] = "[]"; });
  refused([](SafeTensors& t) { t.tensors.erase("mlp.1.bias"); });
  refused([](SafeTensors& t) { t.tensors["mlp.1.weight"].shape = {16, 29}; });
  refused([](SafeTensors& t) { t.tensors["input.deviation"].values[5] = 0.0F; });
  refused([](SafeTensors& t) { t.tensors["mlp.0.weight"].values[5] += 5.0F; });
  refused([](SafeTensors& t) { t.metadata["steps"] = "many"; });
  refused([](SafeTensors& t) { t.metadata["rate_hz"] = "100"; });
  refused([](SafeTensors& t) { t.metadata.erase("rate_hz"); });
  refused([](SafeTensors& t) { t.metadata["action"] = "target = action"; });
  refused([](SafeTensors& t) { t.metadata["gait"] = "[1]"; });
  refused([](SafeTensors& t) { t.metadata["gait"].replace(t.metadata["gait"].find("max_turn"), 8, "min_turn"); });
  refused([](SafeTensors& t) { t.metadata["gait"].replace(t.metadata["gait"].find("0.12"), 4, "-0.1"); });
  refused([](SafeTensors& t) { t.metadata["gait"].replace(t.metadata["gait"].find("1.4"), 3, "0.0"); });
  refused([](SafeTensors& t) { t.metadata["gait"] = test::deep_json(); });
  refused([](SafeTensors& t) { t.metadata["observation"] = test::deep_json(); });
  refused([](SafeTensors& t) { t.metadata["joints"] = "[" + test::deep_json() + "]"; });
  std::filesystem::remove(path);
}

TEST(WbcNetwork, AMessageShowsLittleOfTheFilesText) {
  const std::string path = temporary("long");
  save_wbc_network(path, small_network(WbcKind::kOracle), TensorType::kF32);
  for (const char* key : {"robot", "steps", "kind", "rate_hz", "action"}) {
    SafeTensors bad = read_safetensors(path);
    const std::string good = bad.metadata[key];
    bad.metadata[key] = "\x1b[31m" + std::string(400'000, 'x');
    write_safetensors(path, bad);
    EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_wbc_network(path, *g1()); }));
    bad.metadata[key] = good;
    write_safetensors(path, bad);
  }
  std::filesystem::remove(path);
}

TEST(WbcNetwork, ATruncatedFileIsRefused) {
  const std::string path = temporary("short");
  save_wbc_network(path, small_network(WbcKind::kOracle), TensorType::kF32);
  const std::string bytes = read_file(path);
  write_file(path, std::string_view(bytes).substr(0, bytes.size() - 100));
  EXPECT_THROW(load_wbc_network(path, *g1()), InputError);
  std::filesystem::remove(path);
}

TEST(WbcSim, TargetsKeepWithinTheLimitsAndTheGainsAreTheNetworks) {
  for (const WbcKind kind : {WbcKind::kOracle, WbcKind::kStudent}) {
    WbcNetwork network = small_network(kind);
    network.mlp.layers.back().b.setConstant(100.0F);  // every action at its bound
    const auto controller = make_wbc_sim_controller(g1(), std::make_shared<const WbcNetwork>(network));
    JointCommand command;
    controller->reset(g1()->standing_state());
    for (int i = 0; i < 5; ++i) controller->act(g1()->standing_state(), standing_reference(), command);
    EXPECT_TRUE((command.q_target.array() <= g1()->upper().array()).all());
    EXPECT_EQ(command.kp, network.kp);
    EXPECT_TRUE(controller_info("wbc_sim").walks);
  }
}

TEST(WbcSim, AnEpisodeDoesNotDependOnTheOneBefore) {
  const auto network = std::make_shared<const WbcNetwork>(small_network(WbcKind::kStudent));
  const auto controller = make_wbc_sim_controller(g1(), network);
  const auto run = [&] {
    JointCommand command;
    controller->reset(g1()->standing_state());
    for (int i = 0; i < 20; ++i) controller->act(g1()->standing_state(), standing_reference(0.01 * i), command);
    return command.q_target;
  };
  const Eigen::VectorXd first = run();
  EXPECT_EQ(first, run());
}

}  // namespace
}  // namespace duet
