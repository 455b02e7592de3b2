#include "duet/nn/network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/nn/mlp.h"
#include "duet/nn/safetensors.h"
#include "tests/backends/allocation_count.h"
#include "tests/nn/evaluate.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::FloatNear;
using ::testing::Pointwise;

constexpr double kTolerance = 1e-5;

// The outputs of ONNX Runtime 1.16.3 for test::wave().
const std::vector<float> kHomie = {1.621504F,   -0.4413289F, -0.451069F, 0.2446406F, 1.499561F, -0.2426685F,
                                   -0.6993031F, 0.9277365F,  0.4702923F, 1.281899F,  -1.4428F,  0.1635714F};
const std::vector<float> kTwist2 = {-1.799943F,  -0.1862341F, 0.02289873F, -0.4585755F, -0.7746909F, -0.2291465F,
                                    -0.1292005F, -0.5266997F, 0.7326086F,  0.7954054F,  0.9774022F,  -0.4419506F,
                                    -0.6243433F, 0.4866512F,  0.60649F,    0.6950721F,  -0.6950759F, 0.03133754F,
                                    -0.7967066F, 0.1574676F,  1.308852F,   -0.6270058F, 2.225753F,   1.61574F,
                                    -1.080222F,  -0.275581F,  2.881738F,   -0.7926737F, -0.5891808F};
const std::vector<float> kPlayground = {
    -0.03404216F, 0.18611F,     -0.1617039F,  0.192837F,   -0.1682846F, -0.05698057F, -0.3521344F, -0.02818271F,
    0.3307241F,   -0.07400152F, -0.1267114F,  -0.2700883F, -0.0780508F, -0.08273568F, -0.1306079F, 0.01864804F,
    -0.06357676F, -0.1335106F,  -0.08789083F, 0.2637823F,  0.4697124F,  0.09000928F,  -0.1730191F, -0.1029268F,
    -0.1036182F,  0.0215461F,   -0.33997F,    0.04942394F, 0.3366146F};
// unitree_rl_gym's policy over three steps: its weights in an ONNX LSTM.
const std::vector<std::vector<float>> kMotion = {
    {2.171534F, -0.02116936F, 1.009734F, 0.08146754F, 2.721016F, -0.5885162F, -3.014837F, 0.4727393F, -0.3247981F,
     1.188251F, 0.5802138F, -0.9928402F},
    {2.572863F, -0.1273744F, 1.156013F, 0.6880231F, 4.761365F, -1.010299F, -3.071687F, 0.5444020F, -0.4132211F,
     1.266765F, 0.1035468F, -1.207956F},
    {2.688841F, -0.4426731F, 1.239259F, 0.4060141F, 4.619983F, -1.540201F, -2.951133F, 0.9070728F, -0.6674466F,
     1.163718F, -0.4837467F, -1.377234F}};

void expect_reference(const std::string& name, const std::vector<float>& reference) {
  const std::string path = test::shared_file("models/" + name);
  if (path.empty()) GTEST_SKIP() << "not run: " << name << " absent";
  const auto network = load_network(path);
  ASSERT_EQ(network->inputs().size(), 1U);
  EXPECT_THAT(test::evaluate(*network, {test::wave(network->inputs()[0].size)})[0],
              Pointwise(FloatNear(kTolerance), reference));
}

TEST(Network, HomieEqualsOnnxRuntime) { expect_reference("homie_deploy.onnx", kHomie); }
TEST(Network, Twist2EqualsOnnxRuntime) { expect_reference("twist2_1017_20k.onnx", kTwist2); }
TEST(Network, PlaygroundEqualsOnnxRuntime) { expect_reference("playground_g1_policy.onnx", kPlayground); }

TEST(Network, UnitreeEqualsOnnxRuntimeOverThreeStepsAndAfterReset) {
  const std::string path = test::shared_file("models/unitree_rl_gym_g1_motion.pt");
  if (path.empty()) GTEST_SKIP() << "not run: unitree_rl_gym_g1_motion.pt absent";
  for (const std::string& engine : network_engines()) {
    const auto network = load_network(path, engine);
    for (int episode = 0; episode < 2; ++episode, network->reset())
      for (const std::vector<float>& step : kMotion)
        EXPECT_THAT(test::evaluate(*network, {test::wave(47)})[0], Pointwise(FloatNear(kTolerance), step)) << engine;
  }
}

TEST(Network, PublishedPoliciesAllocateNothingInRun) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: a counting malloc is absent";
  bool any = false;
  for (const char* name :
       {"homie_deploy.onnx", "twist2_1017_20k.onnx", "playground_g1_policy.onnx", "unitree_rl_gym_g1_motion.pt"}) {
    const std::string path = test::shared_file(std::string("models/") + name);
    if (path.empty()) continue;
    any = true;
    const auto network = load_network(path);
    const std::vector<float> in = test::wave(network->inputs()[0].size);
    std::vector<float> out(network->outputs()[0].size);
    const std::span<const float> inputs[] = {in};
    const std::span<float> outputs[] = {out};
    network->run(inputs, outputs);
    const long before = test::allocation_count();
    network->run(inputs, outputs);
    network->reset();
    EXPECT_EQ(test::allocation_count() - before, 0) << name;
  }
  if (!any) GTEST_SKIP() << "not run: published policies absent";
}

TEST(Network, NanInComesOutAsNan) {
  const std::string path = test::shared_file("models/homie_deploy.onnx");
  if (path.empty()) GTEST_SKIP() << "not run: homie_deploy.onnx absent";
  const auto network = load_network(path);
  std::vector<float> in = test::wave(456);
  in[450] = std::nanf("");
  const std::vector<float> out = test::evaluate(*network, {in})[0];
  for (const float value : out) EXPECT_TRUE(std::isnan(value));
}

TEST(Network, APerceptronInSafetensorsIsRecognised) {
  const test::ScratchFolder folder;
  Random random(1, 2);
  const Mlp mlp = random_mlp({5, 8, 3}, 0.5F, random);
  SafeTensors content;
  add_mlp(content, "student", mlp);
  write_safetensors(folder / "net", content);
  const auto network = load_network(folder / "net");
  const std::vector<float> x = test::wave(5);
  EXPECT_THAT(test::evaluate(*network, {x})[0], Pointwise(FloatNear(1e-7), MlpRunner(mlp).run(x)));
  add_mlp(content, "teacher", mlp);
  write_safetensors(folder / "two", content);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_network(folder / "two"); }));
}

TEST(Network, UnknownEngineNamesThosePresent) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { load_network("x", "tensorrt"); }));
  EXPECT_EQ(network_engines().front(), "duet");
}

TEST(Network, FilesThatAreNoNetworksAreRefused) {
  const test::ScratchFolder folder;
  const auto refusal = [&](const std::string& bytes) {
    write_file(folder / "net", bytes);
    return test::thrown_message<InputError>([&] { load_network(folder / "net"); });
  };
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal("\x08"));
  // Files that a training keeps: torch.save, a pickle, NumPy's archive.
  const std::string saved = zip_bytes({{"model_100/data.pkl", "x"}, {"model_100/data/0", "1234"}});
  for (const std::string& weights : {saved, std::string("\x80\x02}q."), zip_bytes({{"w.npy", "x"}})})
    EXPECT_SENTENCE(refusal(weights));
  for (const char* text : {"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n",
                           "<!DOCTYPE html><html>404</html>", "hello, this is a text"})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(refusal(zip_bytes({{"a/data.pkl", "x"}, {"a/code/m.py", ""}})));
  EXPECT_SENTENCE(refusal("PK and no more"));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_network(folder / "none"); }));
}

TEST(Network, TruncatedPoliciesAreRefused) {
  const test::ScratchFolder folder;
  for (const char* name : {"playground_g1_policy.onnx", "unitree_rl_gym_g1_motion.pt"}) {
    const std::string path = test::shared_file(std::string("models/") + name);
    if (path.empty()) GTEST_SKIP() << "not run: " << name << " absent";
    const std::string bytes = read_file(path);
    for (const double part : {0.01, 0.3, 0.9, 0.9999}) {
      write_file(folder / "cut", bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size()))));
      EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_network(folder / "cut"); })) << name;
    }
  }
}

// A header of up to 4 GiB is one of a safetensors file, and then what is missing is said in its words.
TEST(Network, AHeaderLengthOfFourGibibytesIsStillSafetensors) {
  const test::ScratchFolder folder;
  for (const std::uint64_t length : {std::uint64_t{1} << 32, (std::uint64_t{1} << 32) + 1}) {
    std::string bytes(9, '{');
    std::memcpy(bytes.data(), &length, sizeof length);
    write_file(folder / "network", bytes);
    const std::string message = test::thrown_message<InputError>([&] { load_network(folder / "network"); });
    EXPECT_EQ(message.find("header") != std::string::npos, length == std::uint64_t{1} << 32) << message;
  }
}

TEST(Mlp, EqualsTheFormulaInDouble) {
  Random random(1, 2);
  Mlp mlp = random_mlp({7, 12, 5, 3}, 1.0F, random);
  for (MlpLayer& layer : mlp.layers) layer.b.setLinSpaced(-0.5F, 0.5F);
  Eigen::VectorXf input = Eigen::VectorXf::LinSpaced(7, -1.0F, 2.0F);
  Eigen::VectorXd x = input.cast<double>();
  for (size_t i = 0; i < mlp.layers.size(); ++i) {
    x = (mlp.layers[i].W.cast<double>() * x + mlp.layers[i].b.cast<double>()).eval();
    if (i + 1 < mlp.layers.size())
      for (double& value : x) value = value > 0 ? value : std::expm1(value);
  }
  MlpRunner runner(mlp);
  const std::span<const float> y = runner.run({input.data(), 7});
  ASSERT_EQ(y.size(), 3U);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(y[i], x[i], 1e-5);
}

// Weights that half precision holds run from it: the sums are the same but for their order.
TEST(Mlp, WeightsInHalfPrecisionGiveWhatTheyGiveInFloat) {
  Random random(3, 4);
  Mlp mlp = random_mlp({37, 50, 18, 5}, 1.0F, random);
  for (MlpLayer& layer : mlp.layers)
    layer.W = layer.W.unaryExpr([](float w) { return static_cast<float>(Eigen::half(w)); }).eval();
  const Eigen::VectorXf input = Eigen::VectorXf::LinSpaced(37, -1.0F, 2.0F);
  Mlp inexact = mlp;
  for (MlpLayer& layer : inexact.layers) layer.W(0, 0) += 1e-7F;  // one weight is enough
  MlpRunner half(mlp), full(inexact);
  const std::span<const float> a = half.run({input.data(), 37}), b = full.run({input.data(), 37});
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(a[i], b[i], 2e-5);
}

TEST(Mlp, SizesAreThoseAskedFor) {
  Random random(1, 2);
  EXPECT_EQ(random_mlp({4, 3, 2}, 1.0F, random).sizes(), (std::vector<int>{4, 3, 2}));
}

TEST(RandomMlp, TheLastLayerHasAScaleOfItsOwn) {
  Random random(3, 1);
  const Mlp mlp = random_mlp({50, 80, 60, 40}, 0.01F, random);
  ASSERT_EQ(mlp.layers.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::MatrixXf& W = mlp.layers[i].W;
    const float deviation = std::sqrt(W.squaredNorm() / static_cast<float>(W.size()));
    const float expected = (i == 2 ? 0.01F : 1.3F) / std::sqrt(static_cast<float>(W.cols()));
    EXPECT_NEAR(deviation, expected, 0.1F * expected) << i;
  }
}

}  // namespace
}  // namespace duet
