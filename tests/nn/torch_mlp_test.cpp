// TorchScript modules that are chains of linear layers and activations, written here as PyTorch writes them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/nn/torch/torch_script.h"
#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

using ::testing::HasSubstr;

std::string byte_of(int code) { return std::string(1, static_cast<char>(code)); }

// The opcodes of a pickle of protocol 2.
std::string number(std::int32_t value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}
std::string text(const std::string& value) { return "X" + number(static_cast<int>(value.size())) + value; }
std::string numbers(const std::vector<int>& values) {
  std::string bytes = "(";
  for (const int value : values) bytes += "J" + number(value);
  return bytes + "t";
}
std::string object(const std::string& module, const std::string& name, const std::string& members) {
  return "c" + module + "\n" + name + "\n)" + byte_of(0x81) + "}(" + members + "ub";
}
struct StoredTensor {
  int storage = 0;
  std::vector<int> sizes{}, strides{};
  int first = 0;
  std::string kind = "FloatStorage";
};
std::string tensor(const StoredTensor& t) {
  return "ctorch._utils\n_rebuild_tensor_v2\n((" + text("storage") + "ctorch\n" + t.kind + "\n" +
         text(std::to_string(t.storage)) + text("cpu") + "K" + byte_of(9) + "tQ" + "J" + number(t.first) +
         numbers(t.sizes) + numbers(t.strides) + byte_of(0x88) + "ccollections\nOrderedDict\n)RtR";
}
std::string linear(const StoredTensor& weight, const std::string& bias, const std::string& mangle = "") {
  return object("__torch__.torch.nn.modules.linear" + mangle, "Linear",
                text("weight") + tensor(weight) + text("bias") + bias);
}
std::string activation(const std::string& name) {
  return object("__torch__.torch.nn.modules.activation", name, text("training") + byte_of(0x89));
}

// 3 inputs, 4 hidden, 2 outputs; ELU of alpha 0.5 between them.
struct Mlp3 {
  std::vector<Operand> tensors = {operand({4, 3}, 0), operand({4}, 1), operand({2, 4}, 2), operand({2}, 3)};
  StoredTensor first{.storage = 0, .sizes = {4, 3}, .strides = {3, 1}};
  StoredTensor second{.storage = 2, .sizes = {2, 4}, .strides = {4, 1}};
  std::string bias = tensor({.storage = 1, .sizes = {4}, .strides = {1}});
  std::string last_bias = tensor({.storage = 3, .sizes = {2}, .strides = {1}});
  std::string between = activation("ELU");
  std::string forward =
      "    a_Gemm = getattr(self, \"a/Gemm\")\n"
      "    a_gemm = (a_Gemm).forward(input_1, )\n"
      "    b_Elu = getattr(self, \"b/Elu\")\n"
      "    b_elu = (b_Elu).forward(a_gemm, )\n"
      "    c_Gemm = getattr(self, \"c/Gemm\")\n"
      "    c_gemm = (c_Gemm).forward(b_elu, )\n"
      "    return c_gemm\n";
  std::string more = {};  // members of the module
  std::map<std::string, std::string> sources = {
      {"torch/nn/modules/activation.py", "class ELU(Module):\n  alpha : Final[float] = 0.5\n\nclass Tanh(Module):\n"}};

  [[nodiscard]] std::string module() const {
    return object("__torch__.torch.fx.graph_module", "GraphModule",
                  text("_lineno_map") + "ctorch.jit._pickle\nrestore_type_tag\n}(K\x01K\x01u" + text("Dict[int, int]") +
                      byte_of(0x86) + "R" + text("a/Gemm") + linear(first, bias) + text("b/Elu") + between +
                      text("c/Gemm") + linear(second, last_bias, ".___torch_mangle_0") + more);
  }
  [[nodiscard]] std::string archive(const std::string& pickle) const {
    std::vector<ZipEntry> entries = {{"policy/data.pkl", byte_of(0x80) + byte_of(2) + pickle + "."},
                                     {"policy/byteorder", "little"}};
    std::map<std::string, std::string> code = sources;
    code.emplace("torch/fx/graph_module.py",
                 "class GraphModule(Module):\n  training : bool\n"
                 "  def forward(self: __torch__.torch.fx.graph_module.GraphModule,\n    input_1: Tensor) -> Tensor:\n" +
                     forward);
    for (const auto& [path, source] : code) entries.push_back({"policy/code/__torch__/" + path, source});
    for (std::size_t k = 0; k < tensors.size(); ++k)
      entries.push_back(
          {"policy/data/" + std::to_string(k), std::string(reinterpret_cast<const char*>(tensors[k].values.data()),
                                                           tensors[k].values.size() * sizeof(float))});
    return zip_bytes(entries);
  }
  [[nodiscard]] std::unique_ptr<Network> network(const std::string& pickle) const {
    return torch_script_network(archive(pickle), "policy.pt");
  }
  [[nodiscard]] std::unique_ptr<Network> network() const { return network(module()); }
  [[nodiscard]] std::string refusal(const std::string& pickle) const {
    return thrown_message<InputError>([&] { (void)network(pickle); });
  }
  [[nodiscard]] std::string refusal() const { return refusal(module()); }
};

double half_elu(double x) { return x > 0.0 ? x : 0.5 * std::expm1(x); }

// W x + b of the operands from `first` on; `transposed`: W is stored column by column.
std::vector<double> layer(const std::vector<Operand>& tensors, int first, const std::vector<double>& x,
                          bool transposed = false) {
  const std::size_t rows = tensors[first + 1].values.size();
  std::vector<double> y;
  for (std::size_t r = 0; r < rows; ++r) {
    double sum = static_cast<double>(tensors[first + 1].values[r]);
    for (std::size_t c = 0; c < x.size(); ++c)
      sum += static_cast<double>(tensors[first].values[transposed ? c * rows + r : r * x.size() + c]) * x[c];
    y.push_back(sum);
  }
  return y;
}

std::vector<double> expected_of(const Mlp3& file, const std::function<double(double)>& between,
                                bool transposed = false) {
  const std::vector<float> x = wave(3);
  std::vector<double> hidden = layer(file.tensors, 0, {x.begin(), x.end()}, transposed);
  for (double& value : hidden) value = between(value);
  return layer(file.tensors, 2, hidden);
}

void expect_near(const std::vector<float>& found, const std::vector<double>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-5) << k;
}

TEST(TorchMlp, AGraphModuleIsItsLayersOneAfterAnother) {
  const Mlp3 file;
  const auto network = file.network();
  ASSERT_EQ(network->inputs().size(), 1U);
  EXPECT_EQ(network->inputs()[0].name, "x");
  EXPECT_EQ(network->inputs()[0].size, 3);
  EXPECT_EQ(network->outputs()[0].name, "action");
  EXPECT_EQ(network->outputs()[0].size, 2);
  expect_near(evaluate(*network, {wave(3)})[0], expected_of(file, half_elu));
}

TEST(TorchMlp, EveryActivationIsItsFormula) {
  const std::tuple<const char*, const char*, std::function<double(double)>> all[] = {
      {"Tanh", "", [](double x) { return std::tanh(x); }},
      {"ReLU", "", [](double x) { return std::max(x, 0.0); }},
      {"Sigmoid", "", [](double x) { return 1.0 / (1.0 + std::exp(-x)); }},
      {"LeakyReLU", "  negative_slope : Final[float] = 0.2\n", [](double x) { return x > 0.0 ? x : 0.2 * x; }}};
  for (const auto& [name, line, formula] : all) {
    Mlp3 file;
    file.between = activation(name);
    file.sources["torch/nn/modules/activation.py"] = std::string("class ") + name + "(Module):\n" + line;
    expect_near(evaluate(*file.network(), {wave(3)})[0], expected_of(file, formula));
  }
}

// torch.jit.trace keeps no numbers of a module: they stand in the calls of its code, one call in another.
TEST(TorchMlp, ATracedActivationIsReadFromItsCode) {
  const std::tuple<const char*, const char*, std::function<double(double)>> all[] = {
      {"ELU", "torch.elu(argument_1, 0.5)", half_elu},
      {"LeakyReLU", "torch.leaky_relu(argument_1, 0.2)", [](double x) { return x > 0.0 ? x : 0.2 * x; }}};
  for (const auto& [name, code, formula] : all) {
    Mlp3 file;
    file.between = activation(name);
    file.sources["torch/nn/modules/activation.py"] =
        std::string("class ") + name +
        "(Module):\n  training : bool\n  def forward(self: A,\n    argument_1: Tensor) -> Tensor:\n    return " + code +
        "\n";
    file.forward =
        "    input = torch.detach(input_1)\n"
        "    _0 = (getattr(self, \"b/Elu\")).forward((getattr(self, \"a/Gemm\")).forward(input, ), )\n"
        "    return (getattr(self, \"c/Gemm\")).forward(_0, )\n";
    expect_near(evaluate(*file.network(), {wave(3)})[0], expected_of(file, formula));
  }
}

TEST(TorchMlp, ASequentialWithinAModuleIsRead) {
  Mlp3 file;
  file.sources["torch/nn/modules/container.py"] =
      "class Sequential(Module):\n"
      "  def forward(self: __torch__.torch.nn.modules.container.Sequential,\n    input: Tensor) -> Tensor:\n"
      "    _0 = getattr(self, \"0\")\n    _1 = getattr(self, \"1\")\n    _2 = getattr(self, \"2\")\n"
      "    input0 = (_0).forward(input, )\n    input1 = (_1).forward(input0, )\n    return (_2).forward(input1, )\n";
  file.sources["policy.py"] =
      "class Policy(Module):\n  actor : __torch__.torch.nn.modules.container.Sequential\n"
      "  def forward(self: __torch__.policy.Policy,\n    obs: Tensor) -> Tensor:\n"
      "    actor = self.actor\n    return (actor).forward(obs, )\n";
  const std::string chain = object("__torch__.torch.nn.modules.container", "Sequential",
                                   text("0") + linear(file.first, file.bias) + text("1") + file.between + text("2") +
                                       linear(file.second, file.last_bias));
  const auto network = file.network(object("__torch__.policy", "Policy", text("actor") + chain));
  expect_near(evaluate(*network, {wave(3)})[0], expected_of(file, half_elu));
}

TEST(TorchMlp, AWeightIsReadByItsStridesAndMayHaveNoBias) {
  Mlp3 file;
  file.first.strides = {1, 4};  // stored column by column
  expect_near(evaluate(*file.network(), {wave(3)})[0], expected_of(file, half_elu, true));
  Mlp3 bare;
  bare.last_bias = "N";
  bare.tensors[3].values = {0.0F, 0.0F};
  expect_near(evaluate(*bare.network(), {wave(3)})[0], expected_of(bare, half_elu));
}

TEST(TorchMlp, OtherModulesAreRefusedByName) {
  Mlp3 file;
  file.between = activation("Softmax");
  EXPECT_SENTENCE(file.refusal());
  Mlp3 none;
  none.forward = "    return input_1\n";
  EXPECT_SENTENCE(none.refusal());
  Mlp3 scaled;
  scaled.sources["torch/nn/modules/activation.py"] = "class ELU(Module):\n  training : bool\n";
  EXPECT_SENTENCE(scaled.refusal());
  Mlp3 unknown;
  unknown.sources.clear();
  EXPECT_SENTENCE(unknown.refusal());
  Mlp3 number;
  number.between = "K\x05";
  EXPECT_SENTENCE(number.refusal());
}

TEST(TorchMlp, CodeThatDoesMoreThanHandOneTensorOnIsRefused) {
  const auto line = [](const std::string& code) {
    Mlp3 file;
    file.forward = code + "    return input_1\n";
    return file.refusal();
  };
  for (const char* text :
       {"    x = torch.cumsum(input_1, 0)\n", "    x = torch.add(input_1, input_1, alpha=2)\n",
        "    x = torch.add(input_1\n", "    x = (a).forward(input_1, )\n", "    x = (self.gone).forward(input_1, )\n",
        "    if input_1:\n      pass\n    else:\n      pass\n"})
    EXPECT_SENTENCE(line(text));
  Mlp3 endless;
  endless.forward = "    a = getattr(self, \"a/Gemm\")\n";
  EXPECT_SENTENCE(endless.refusal());
  Mlp3 two;
  two.forward = "";
  two.sources["torch/fx/graph_module.py"] =
      "class GraphModule(Module):\n  def forward(self: G,\n    a: Tensor,\n    b: Tensor) -> Tensor:\n    return a\n";
  EXPECT_SENTENCE(two.refusal());
}

TEST(TorchMlp, AModuleThatHoldsItselfIsRefused) {
  Mlp3 file;
  file.forward = "    a = getattr(self, \"me\")\n    return (a).forward(input_1, )\n";
  // The object is kept in place 1 of the memo before its members are read.
  const std::string self =
      "c__torch__.torch.fx.graph_module\nGraphModule\n)" + byte_of(0x81) + "q\x01}(" + text("me") + "h\x01ub";
  EXPECT_SENTENCE(file.refusal(self));
}

TEST(TorchMlp, TensorsThatDoNotFitTheirNumbersAreRefused) {
  const auto weight = [](const StoredTensor& changed) {
    Mlp3 file;
    file.first = changed;
    return file.refusal();
  };
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 4}, .strides = {3, 1}}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 3}, .strides = {3, 1}, .first = 1}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 3}, .strides = {3, 1}, .first = -1}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 3}, .strides = {4, 1}}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 3}, .strides = {0, 0}}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {1 << 30, 1 << 30}, .strides = {1, 1}}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {0, 3}, .strides = {3, 1}}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 3}, .strides = {3}}));
  EXPECT_SENTENCE(weight({.storage = 9, .sizes = {4, 3}, .strides = {3, 1}}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {4, 3}, .strides = {3, 1}, .kind = "LongStorage"}));
  EXPECT_SENTENCE(weight({.storage = 0, .sizes = {12}, .strides = {1}}));
  Mlp3 narrow;
  narrow.second = {.storage = 2, .sizes = {2, 3}, .strides = {4, 1}};
  EXPECT_SENTENCE(narrow.refusal());
}

TEST(TorchMlp, PicklesThatDoMoreThanHoldTensorsAreRefused) {
  const Mlp3 file;
  EXPECT_SENTENCE(file.refusal("cposix\nsystem\n(" + text("id") + "tR"));
  EXPECT_SENTENCE(file.refusal("\x8f"));
  for (const char* broken : {"", "t", "R", "b", "h\x07", "u", "(K\x01u", "Q",
                             "K\x01K\x02"
                             "b",
                             "e"})
    EXPECT_SENTENCE(file.refusal(broken));
  const std::string whole = file.module();
  for (std::size_t size = 0; size < whole.size(); size += 7)
    EXPECT_THAT(file.refusal(whole.substr(0, size)), HasSubstr("'policy.pt': TorchScript: ")) << size;
}

// ---- IsaacLab's exporter (isaaclab_rl.rsl_rl.exporter._TorchPolicyExporter, rsl_rl's normaliser), as torch.jit.script
// prints it.
constexpr const char* kExporterHead =
    "class _TorchPolicyExporter(Module):\n  __parameters__ = []\n  training : bool\n  is_recurrent : bool\n"
    "  def forward(self: __torch__.exporter._TorchPolicyExporter,\n    x: Tensor) -> Tensor:\n";
constexpr const char* kNormaliser =
    "class EmpiricalNormalization(Module):\n  __parameters__ = []\n  _mean : Tensor\n  _std : Tensor\n  training : "
    "bool\n"
    "  eps : float\n"
    "  def forward(self: __torch__.rsl_rl.EmpiricalNormalization,\n    x: Tensor) -> Tensor:\n"
    "    training = self.training\n    if training:\n      _0 = (self).update(x, )\n    else:\n      pass\n"
    "    _mean = self._mean\n    _std = self._std\n    eps = self.eps\n"
    "    return torch.div(torch.sub(x, _mean), torch.add(_std, eps))\n";
constexpr const char* kChainForward =
    "    actor = self.actor\n    normalizer = self.normalizer\n"
    "    _0 = (actor).forward((normalizer).forward(x, ), )\n    return _0\n"
    "  def reset(self: __torch__.exporter._TorchPolicyExporter) -> NoneType:\n    return None\n";

std::string real(double value) {  // BINFLOAT: big-endian
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return "G" + std::string(bytes.rbegin(), bytes.rend());
}

// Tensors 0 to 3 are the actor's; 4 and 5 the normaliser's mean and deviation.
struct Exporter : Mlp3 {
  std::string actor,
      normaliser = object("__torch__.torch.nn.modules.linear", "Identity", text("training") + byte_of(0x89));

  Exporter() {
    sources["torch/nn/modules/container.py"] =
        "class Sequential(Module):\n"
        "  def forward(self: __torch__.torch.nn.modules.container.Sequential,\n    input: Tensor) -> Tensor:\n"
        "    _0 = getattr(self, \"0\")\n    _1 = getattr(self, \"1\")\n    _2 = getattr(self, \"2\")\n"
        "    input0 = (_0).forward(input, )\n    input1 = (_1).forward(input0, )\n    return (_2).forward(input1, )\n";
    sources["exporter.py"] = std::string(kExporterHead) + kChainForward;
    sources["rsl_rl.py"] = kNormaliser;
    actor = object("__torch__.torch.nn.modules.container", "Sequential",
                   text("0") + linear(first, bias) + text("1") + between + text("2") + linear(second, last_bias));
    tensors.push_back(operand({3}, 4));
    tensors.push_back(operand({3}, 5));
    for (float& value : tensors[5].values) value = std::abs(value) + 0.5F;
  }
  void normalise() {
    normaliser = object("__torch__.rsl_rl", "EmpiricalNormalization",
                        text("_mean") + tensor({.storage = 4, .sizes = {1, 3}, .strides = {3, 1}}) + text("_std") +
                            tensor({.storage = 5, .sizes = {1, 3}, .strides = {3, 1}}) + text("training") +
                            byte_of(0x89) + text("eps") + real(0.01));
  }
  [[nodiscard]] std::string module_with(const std::string& more) const {
    return object("__torch__.exporter", "_TorchPolicyExporter",
                  text("training") + byte_of(0x89) + text("actor") + actor + text("normalizer") + normaliser + more);
  }
  [[nodiscard]] std::vector<double> normalised(const std::vector<float>& x) const {
    std::vector<double> values(x.begin(), x.end());
    if (normaliser.find("Identity") != std::string::npos) return values;
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] =
          (values[i] - static_cast<double>(tensors[4].values[i])) / (static_cast<double>(tensors[5].values[i]) + 0.01);
    return values;
  }
  [[nodiscard]] std::vector<double> acted(const std::vector<double>& x) const {
    std::vector<double> hidden = layer(tensors, 0, x);
    for (double& value : hidden) value = half_elu(value);
    return layer(tensors, 2, hidden);
  }
};

TEST(TorchMlp, IsaacLabsExporterIsItsActorBehindItsNormaliser) {
  Exporter plain;
  const auto alone = plain.network(plain.module_with(""));
  EXPECT_EQ(alone->inputs()[0].size, 3);
  expect_near(evaluate(*alone, {wave(3)})[0], plain.acted(plain.normalised(wave(3))));
  EXPECT_EQ(evaluate(*alone, {wave(3)})[0], evaluate(*Mlp3().network(), {wave(3)})[0]);
  Exporter normalising;
  normalising.normalise();
  const auto network = normalising.network(normalising.module_with(""));
  EXPECT_EQ(network->inputs()[0].size, 3);
  expect_near(evaluate(*network, {wave(3)})[0], normalising.acted(normalising.normalised(wave(3))));
}

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }

// A recurrent layer of 3 inputs and 3 hidden before the actor; its tensors are 6 to 9.
struct RecurrentExporter : Exporter {
  bool lstm;
  int gates;
  std::vector<double> h, c;

  explicit RecurrentExporter(bool lstm_) : lstm(lstm_), gates(lstm_ ? 4 : 3), h(3, 0.0), c(3, 0.0) {
    for (const Shape& shape : {Shape{gates * 3, 3}, Shape{gates * 3, 3}, Shape{gates * 3}, Shape{gates * 3}})
      tensors.push_back(operand(shape, static_cast<int>(tensors.size())));
    tensors.push_back(operand({3}, 0));  // the memory at the export, which is not looked at
    const std::string call =
        lstm ? "(rnn).forward__0(_0, (hidden_state, cell_state), )" : "(rnn).forward__0(_0, hidden_state, )";
    sources["exporter.py"] =
        std::string(kExporterHead) +
        "    normalizer = self.normalizer\n    x0 = (normalizer).forward(x, )\n    rnn = self.rnn\n"
        "    _0 = torch.unsqueeze(x0, 0)\n    hidden_state = self.hidden_state\n" +
        (lstm ? "    cell_state = self.cell_state\n" : "") + "    _1 = " + call + "\n    x1, _2, = _1\n" +
        (lstm ? "    h, c, = _2\n" : "    h = _2\n") +
        "    hidden_state0 = self.hidden_state\n    _3 = torch.copy_(torch.slice(hidden_state0), h)\n" +
        (lstm ? "    cell_state0 = self.cell_state\n    _4 = torch.copy_(torch.slice(cell_state0), c)\n" : "") +
        "    actor = self.actor\n    _5 = (actor).forward(torch.squeeze(x1, 0), )\n    return _5\n";
    sources["torch/nn/modules/rnn.py"] = std::string("class ") + (lstm ? "LSTM" : "GRU") +
                                         "(Module):\n  num_layers : Final[int] = 1\n  proj_size : Final[int] = 0\n"
                                         "  bidirectional : Final[bool] = False\n";
  }
  [[nodiscard]] std::unique_ptr<Network> recurrent() const {
    const auto matrix = [&](int storage) {
      return tensor({.storage = storage, .sizes = {gates * 3, 3}, .strides = {3, 1}});
    };
    const auto vector = [&](int storage) { return tensor({.storage = storage, .sizes = {gates * 3}, .strides = {1}}); };
    const std::string state = tensor({.storage = 10, .sizes = {1, 1, 3}, .strides = {3, 3, 1}});
    return network(module_with(text("rnn") +
                               object("__torch__.torch.nn.modules.rnn", lstm ? "LSTM" : "GRU",
                                      text("weight_ih_l0") + matrix(6) + text("weight_hh_l0") + matrix(7) +
                                          text("bias_ih_l0") + vector(8) + text("bias_hh_l0") + vector(9)) +
                               text("hidden_state") + state + (lstm ? text("cell_state") + state : "")));
  }
  [[nodiscard]] double row(int matrix, int bias, int row, const std::vector<double>& x) const {
    double sum = static_cast<double>(tensors[bias].values[row]);
    for (int k = 0; k < 3; ++k) sum += static_cast<double>(tensors[matrix].values[row * 3 + k]) * x[k];
    return sum;
  }
  // PyTorch's formulas of LSTM (i, f, g, o) and GRU (r, z, n).
  std::vector<double> step(const std::vector<float>& input) {
    const std::vector<double> x = normalised(input), old = h;
    const auto in = [&](int gate, int k) { return row(6, 8, gate * 3 + k, x); };
    const auto back = [&](int gate, int k) { return row(7, 9, gate * 3 + k, old); };
    for (int k = 0; k < 3; ++k) {
      if (lstm) {
        c[k] =
            logistic(in(1, k) + back(1, k)) * c[k] + logistic(in(0, k) + back(0, k)) * std::tanh(in(2, k) + back(2, k));
        h[k] = logistic(in(3, k) + back(3, k)) * std::tanh(c[k]);
      } else {
        const double r = logistic(in(0, k) + back(0, k)), z = logistic(in(1, k) + back(1, k));
        h[k] = (1.0 - z) * std::tanh(in(2, k) + r * back(2, k)) + z * old[k];
      }
    }
    return acted(h);
  }
};

TEST(TorchMlp, IsaacLabsRecurrentExportersRememberAndForget) {
  for (const bool lstm : {true, false})
    for (const bool normalising : {false, true}) {
      RecurrentExporter file(lstm);
      if (normalising) file.normalise();
      const auto network = file.recurrent();
      ASSERT_EQ(network->inputs().size(), 1U);
      ASSERT_EQ(network->outputs().size(), 1U);
      EXPECT_EQ(network->inputs()[0].size, 3);
      std::vector<std::vector<float>> first;
      for (int t = 0; t < 4; ++t) {
        first.push_back(evaluate(*network, {wave(3)})[0]);
        expect_near(first.back(), file.step(wave(3)));
      }
      EXPECT_NE(first[0], first[1]);
      network->reset();
      EXPECT_EQ(evaluate(*network, {wave(3)})[0], first[0]);
    }
}

TEST(TorchMlp, RlSarsTrackerEqualsItsFormula) {
  const std::string path = shared_file("models/rl_sar/policy.pt");
  if (path.empty()) GTEST_SKIP() << "not run: rl_sar/policy.pt absent";
  std::vector<Operand> tensors(8);
  read_zip(read_file(path), path, {1 << 20, 1 << 21}, [&](const std::string& entry, const std::string& content) {
    const std::size_t at = entry.find("/data/");
    if (at == std::string::npos) return;
    std::vector<float>& values = tensors[std::stoi(entry.substr(at + 6))].values;
    values.resize(content.size() / sizeof(float));
    std::memcpy(values.data(), content.data(), content.size());
  });
  const auto network = load_network(path);
  ASSERT_EQ(network->inputs()[0].size, 154);
  const std::vector<float> x = wave(154);
  std::vector<double> value(x.begin(), x.end());
  for (int first = 0; first < 8; first += 2) {
    value = layer(tensors, first, value);
    if (first < 6)
      for (double& each : value) each = each > 0.0 ? each : std::expm1(each);
  }
  expect_near(evaluate(*network, {x})[0], value);
}

}  // namespace
}  // namespace duet::test
