#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <set>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/policies/dstar/network.h"
#include "tests/deep_json.h"
#include "tests/policies/dstar_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::random_network;
using test::small_config;
using test::thrown_message;

void expect_same_but_for_rounding(const DstarNetwork& found, const DstarNetwork& expected, float relative) {
  EXPECT_EQ(found.config, expected.config);
  EXPECT_EQ(found.robot, expected.robot);
  EXPECT_EQ(found.joints, expected.joints);
  EXPECT_EQ(found.channels, expected.channels);
  EXPECT_EQ(found.language, expected.language);
  EXPECT_EQ(found.notes, expected.notes);
  EXPECT_LE((found.frame_mean - expected.frame_mean).cwiseAbs().maxCoeff(), relative);
  EXPECT_LE((found.frame_deviation - expected.frame_deviation).cwiseAbs().maxCoeff(), 2.0F * relative);
  EXPECT_LE((found.plan_mean - expected.plan_mean).cwiseAbs().maxCoeff(), relative);
  EXPECT_LE((found.plan_deviation - expected.plan_deviation).cwiseAbs().maxCoeff(), 2.0F * relative);
  ASSERT_EQ(found.weights.size(), expected.weights.size());
  for (const auto& [name, tensor] : expected.weights) {
    EXPECT_EQ(found.weights.at(name).shape, tensor.shape) << name;
    for (std::size_t i = 0; i < tensor.values.size(); ++i)
      ASSERT_NEAR(found.weights.at(name).values[i], tensor.values[i], relative * (1.0F + std::abs(tensor.values[i])));
  }
}

TEST(DstarFile, IsReadBackAsWritten) {
  const test::ScratchFolder folder;
  const auto network = random_network(small_config());
  save_dstar_network(folder / "a.safetensors", *network, TensorType::kF32);
  const auto read = load_dstar_network(folder / "a.safetensors", *g1());
  expect_same_but_for_rounding(*read, *network, 0.0F);
  save_dstar_network(folder / "b.safetensors", *read, TensorType::kF32);
  EXPECT_TRUE(read_file(folder / "a.safetensors") == read_file(folder / "b.safetensors"));
}

TEST(DstarFile, OfHalfPrecisionHoldsThePlanOfItsRoundedWeights) {
  const test::ScratchFolder folder;
  const auto network = random_network(small_config());
  save_dstar_network(folder / "a.safetensors", *network, TensorType::kF16);
  const auto read = load_dstar_network(folder / "a.safetensors", *g1());
  expect_same_but_for_rounding(*read, *network, 0x1p-11F);
  save_dstar_network(folder / "b.safetensors", *read, TensorType::kF16);
  expect_same_but_for_rounding(*load_dstar_network(folder / "b.safetensors", *g1()), *read, 0.0F);
}

TEST(DstarFile, HoldsNothingOfWhatIsOff) {
  const test::ScratchFolder folder;
  DstarConfig config = small_config();
  config.phase_attention = config.spatial_reasoning = config.short_stream = config.language_on = false;
  save_dstar_network(folder / "a.safetensors", *random_network(config), TensorType::kF32);
  for (const auto& [name, tensor] : read_safetensors(folder / "a.safetensors").tensors)
    for (const char* part : {"phase", "spatial", "short", "language", "distance"})
      EXPECT_EQ(name.find(part), std::string::npos) << name;
  EXPECT_EQ(load_dstar_network(folder / "a.safetensors", *g1())->config, config);
}

TEST(DstarTensors, AreNamedOnceAndStandInThePapersSizes) {
  std::set<std::string> names;
  std::int64_t count = 0;
  for (const TensorShape& tensor : dstar_tensors({})) {
    EXPECT_TRUE(names.insert(tensor.name).second) << tensor.name;
    std::int64_t values = 1;
    for (const std::int64_t size : tensor.shape) values *= size;
    count += values;
    if (tensor.name == "temporal.weight") {
      EXPECT_EQ(tensor.shape, (std::vector<std::int64_t>{256, 1536}));
    }
    if (tensor.name == "condition.1.weight") {
      EXPECT_EQ(tensor.shape, (std::vector<std::int64_t>{256, 1408}));
    }
    if (tensor.name == "denoise.0.film_step.weight") {
      EXPECT_EQ(tensor.shape, (std::vector<std::int64_t>{336, 256}));
    }
    EXPECT_NE(tensor.name, "denoise.0.film_step.bias");
  }
  EXPECT_GT(count, 3'000'000);
  EXPECT_LT(count, 10'000'000);
}

SafeTensors good_content() {
  const test::ScratchFolder folder;
  save_dstar_network(folder / "net", *random_network(small_config()), TensorType::kF32);
  return read_safetensors(folder / "net");
}

// The refusal of a good file after `change`.
std::string refusal(const std::function<void(SafeTensors&)>& change) {
  static const SafeTensors good = good_content();
  const test::ScratchFolder folder;
  const std::string path = folder / "net.safetensors";
  SafeTensors content = good;
  change(content);
  write_safetensors(path, content);
  const std::string message = thrown_message<InputError>([&] { load_dstar_network(path, *g1()); });
  return message.starts_with(path + ": ") ? message.substr(path.size() + 2) : message;
}

std::string header_refusal(const std::string& key, const std::string& value) {
  return refusal([&](SafeTensors& content) { content.metadata[key] = value; });
}

TEST(DstarFile, RefusesHeadersThatAreNotOfThisNetworkAndRobot) {
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.metadata.erase("format"); }));
  EXPECT_SENTENCE(header_refusal("format", "duet.wbc-network/1"));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.metadata.erase("config"); }));
  EXPECT_SENTENCE(header_refusal("config", "{}"));
  EXPECT_EQ(header_refusal("robot", "h1"), "made for 'h1', the robot is '" + g1()->name + "'");
  EXPECT_SENTENCE(header_refusal("joints", "3"));
  EXPECT_SENTENCE(header_refusal("channels", "[1]"));
  for (const char* key : {"joints", "channels", "notes"})
    EXPECT_EQ(header_refusal(key, test::deep_json()), fmt::format("'{}' in the header: {}", key, test::kTooDeep));
  EXPECT_EQ(header_refusal("config", test::deep_json()), std::string("configuration of D-STAR: ") + test::kTooDeep);
  EXPECT_SENTENCE(header_refusal("joints", R"(["left_knee_joint"])"));
  EXPECT_SENTENCE(header_refusal("channels", "[]"));
  EXPECT_SENTENCE(header_refusal("notes", "[]"));
}

TEST(DstarFile, RefusesJointsAndChannelsInAnotherOrder) {
  DstarNetwork network = *random_network(small_config());
  const auto message = [&] {
    const test::ScratchFolder folder;
    save_dstar_network(folder / "net", network, TensorType::kF32);
    return thrown_message<InputError>([&] { load_dstar_network(folder / "net", *g1()); });
  };
  std::swap(network.joints[3], network.joints[4]);
  EXPECT_SENTENCE(message());
  std::swap(network.joints[3], network.joints[4]);
  network.channels[5] = "temperature";
  EXPECT_SENTENCE(message());
}

TEST(DstarFile, RefusesTensorsThatDoNotFit) {
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors.erase("long.1.up.weight"); }));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors["extra"] = {{1}, {1.0F}}; }));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors["temporal.bias"] = {{2}, {1.0F, 2.0F}}; }));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors.erase("frame.mean"); }));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors["plan.mean"] = {{1}, {1.0F}}; }));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors["frame.deviation"].values[7] = 0.0F; }));
  EXPECT_SENTENCE(refusal([](SafeTensors& content) { content.tensors["plan.deviation"].values[8] = -1.0F; }));
}

TEST(DstarFile, RefusesAGoldenPlanThatItMisses) {
  for (const char* name : {"golden.frames", "golden.noise", "golden.language", "golden.distance", "golden.plan"})
    EXPECT_EQ(refusal([&](SafeTensors& content) { content.tensors.erase(name); }),
              std::string("expected a tensor '") + name + "', found none");
  for (const char* name : {"denoise.out.bias", "long.in.weight", "phase.expert.1.weight", "golden.distance",
                           "golden.language", "golden.frames", "golden.plan"})
    EXPECT_SENTENCE(refusal([&](SafeTensors& content) {
      for (float& value : content.tensors[name].values) value = 1.3F * value + 0.1F;
    }));
}

TEST(DstarFile, RefusesNumbersThatAreNotFinite) {
  const test::ScratchFolder folder;
  const std::string path = folder / "net.safetensors";
  save_dstar_network(path, *random_network(small_config()), TensorType::kF32);
  std::string bytes = read_file(path);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + bytes.size() - 4, &nan, 4);
  write_file(path, bytes);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_dstar_network(path, *g1()); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_dstar_network(folder / "none", *g1()); }));
}

TEST(DstarFile, IsNotWrittenForWhatDoesNotFit) {
  const test::ScratchFolder folder;
  const auto message = [&](const std::function<void(DstarNetwork&)>& change) {
    DstarNetwork network = *random_network(small_config());
    change(network);
    return thrown_message<std::invalid_argument>(
        [&] { save_dstar_network(folder / "net", network, TensorType::kF32); });
  };
  EXPECT_SENTENCE(message([](DstarNetwork& network) { network.config.heads = 5; }));
  EXPECT_SENTENCE(message([](DstarNetwork& network) { network.config.layers = 3; }));
  EXPECT_SENTENCE(message([](DstarNetwork& network) { network.joints.pop_back(); }));
  EXPECT_SENTENCE(message([](DstarNetwork& network) { network.plan_mean.resize(3); }));
  EXPECT_FALSE(std::filesystem::exists(folder / "net"));
  EXPECT_THROW(save_dstar_network("/proc/none/net", *random_network(small_config()), TensorType::kF32),
               std::runtime_error);
}

// Counts weights for the paper's sizes, for sizes that all differ, and for the latter without short stream, phases and
// space: a size that stands for another shows in one of them.
TEST(DstarTensors, NumberAsManyWeightsAsTheyDid) {
  const auto weights = [](const DstarConfig& config) {
    std::int64_t sum = 0;
    for (const TensorShape& tensor : dstar_tensors(config)) {
      std::int64_t count = 1;
      for (const std::int64_t size : tensor.shape) count *= size;
      sum += count;
    }
    return sum;
  };
  DstarConfig least = test::small_config();
  least.short_stream = least.phase_attention = least.spatial_reasoning = false;
  EXPECT_EQ(weights({}), 3966551);
  EXPECT_EQ(weights(test::small_config()), 34876);
  EXPECT_EQ(weights(least), 21186);
}

}  // namespace
}  // namespace duet
