#include "duet/controllers/wbc_sim/wbc_sim.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/core/file.h"
#include "duet/core/numbers.h"
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

// The inputs of WBC-Sim's networks, number by number.

TEST(WbcLayout, SizesAreThePrintedTotals) {
  const WbcLayout layout(29);
  EXPECT_EQ(layout.oracle(), 163);
  EXPECT_EQ(layout.student(), 1090);
  EXPECT_EQ(layout.critic(22), 361);
  EXPECT_EQ(g1()->roles.bodies.size(), 22U);
  int sum = 0;
  for (const LayoutEntry& channel : layout.channels(WbcKind::kStudent)) sum += channel.size;
  EXPECT_EQ(sum, 1090);
}

TEST(WbcObservation, EveryChannelIsAtItsPlace) {
  WbcTracker tracker(g1());
  RobotState state = g1()->standing_state();
  state.q[3] += 0.5;
  state.v[4] = 2.0;
  state.w_WB_B = {1.0, 2.0, 3.0};
  state.v_WB = {4.0, 5.0, 6.0};
  Eigen::VectorXf action = Eigen::VectorXf::Zero(29);
  action[7] = 0.25F;
  tracker.reset(standing_reference(0.1, -0.2));
  WbcSensors sensors;
  read_sensors(state, tracker, sensors);
  std::vector<float> o(163);
  write_oracle(sensors, action, o);
  EXPECT_FLOAT_EQ(o[3], 0.5F);
  EXPECT_FLOAT_EQ(o[29 + 4], 2.0F);
  EXPECT_FLOAT_EQ(o[58 + 1], 2.0F);
  EXPECT_FLOAT_EQ(o[61 + 2], 6.0F);
  EXPECT_FLOAT_EQ(o[64 + 2], -1.0F);
  EXPECT_FLOAT_EQ(o[67 + 7], 0.25F);
  EXPECT_NEAR(o[154], 0.1F, 1e-6);
  EXPECT_NEAR(o[155], -0.2F, 1e-6);
  EXPECT_FLOAT_EQ(o[157], 1.0F);  // first column of the identity
  EXPECT_FLOAT_EQ(o[161], 1.0F);  // second column
}

TEST(WbcObservation, HistoryIsOldestFirstWithoutTheCurrentFrame) {
  WbcObserver observer(WbcKind::kStudent, 29);
  WbcTracker tracker(g1());
  tracker.reset(standing_reference());
  WbcSensors sensors;
  read_sensors(g1()->standing_state(), tracker, sensors);
  Eigen::VectorXf action = Eigen::VectorXf::Zero(29);
  const int at = 29 + 29 + 3 + 3, frame = 93, history = 93 + 67;
  action[0] = 7.0F;
  std::span<const float> shown = observer.update(sensors, action);
  ASSERT_EQ(shown.size(), 1090U);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(shown[history + i * frame + at], 7.0F) << "the first stands for all " << i;
  for (int i = 1; i <= 3; ++i) {
    action[0] = static_cast<float>(i);
    shown = observer.update(sensors, action);
  }
  EXPECT_EQ(shown[at], 3.0F);
  EXPECT_EQ(shown[history + 9 * frame + at], 2.0F);
  EXPECT_EQ(shown[history + 8 * frame + at], 1.0F);
  EXPECT_EQ(shown[history + 7 * frame + at], 7.0F);
  observer.reset();
  action[0] = 5.0F;
  shown = observer.update(sensors, action);
  EXPECT_EQ(shown[history + at], 5.0F);
}

// The shipped networks were trained on these numbers, one after another: not one bit may differ.
TEST(WbcObservation, IsTheBitsThatNetworksWereTrainedOn) {
  Random random(3, 5);
  const auto drawn = [&](int size) {
    Eigen::VectorXd values(size);
    for (double& value : values) value = random.normal();
    return values;
  };
  WbcSensors sensors;
  std::vector<float> past, now;
  WbcObserver observer(WbcKind::kStudent, 29);
  for (int tick = 0; tick < 15; ++tick) {
    sensors.q = drawn(29), sensors.v = drawn(29), sensors.q_ref = drawn(29), sensors.v_ref = drawn(29);
    sensors.w = drawn(3), sensors.velocity_B = drawn(3), sensors.gravity = drawn(3), sensors.root_error = drawn(3);
    sensors.root_turn = drawn(6);
    const Eigen::VectorXf action = drawn(29).cast<float>();
    const auto put = [](std::vector<float>& to, const auto& values) {
      for (const auto value : values) to.push_back(static_cast<float>(value));
    };
    std::vector<float> frame, reference, oracle;
    for (const auto* values : {&sensors.q, &sensors.v}) put(frame, *values), put(oracle, *values);
    put(frame, sensors.w), put(oracle, sensors.w), put(oracle, sensors.velocity_B);
    put(frame, sensors.gravity), put(oracle, sensors.gravity), put(frame, action), put(oracle, action);
    for (const auto* values : {&sensors.q_ref, &sensors.v_ref}) put(reference, *values);
    put(reference, sensors.root_error), put(reference, sensors.root_turn);
    oracle.insert(oracle.end(), reference.begin(), reference.end());
    if (past.empty())
      for (int i = 0; i < 10; ++i) past.insert(past.end(), frame.begin(), frame.end());
    now = frame;
    now.insert(now.end(), reference.begin(), reference.end());
    now.insert(now.end(), past.begin(), past.end());
    past.erase(past.begin(), past.begin() + 93);
    past.insert(past.end(), frame.begin(), frame.end());
    const std::span<const float> student = observer.update(sensors, action);
    ASSERT_EQ(std::vector<float>(student.begin(), student.end()), now) << tick;
    std::vector<float> shown(163);
    write_oracle(sensors, action, shown);
    ASSERT_EQ(shown, oracle) << tick;
  }
}

}  // namespace
}  // namespace duet
