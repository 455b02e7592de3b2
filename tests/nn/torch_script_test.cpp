#include "duet/nn/torch/torch_script.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>

#include "duet/archives/zip/zip.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/nn/network.h"
#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

// An archive as PyTorch writes it: 5 inputs, 4 hidden, 3 and 2 outputs.
struct Export {
  std::map<std::string, std::string> code = {
      {"helpers.py", "class PolicyExporterLSTM(Module):\n"},
      {"container.py",
       "  __annotations__[\"0\"] = __torch__.torch.nn.modules.linear.Linear\n"
       "  __annotations__[\"1\"] = __torch__.torch.nn.modules.activation.ELU\n"
       "  __annotations__[\"2\"] = __torch__.torch.nn.modules.linear.___torch_mangle_0.Linear\n"},
      {"activation.py", "  alpha : Final[float] = 1.\n"},
      {"rnn.py",
       "  num_layers : Final[int] = 1\n  proj_size : Final[int] = 0\n  bidirectional : Final[bool] = False\n"}};
  std::vector<Operand> tensors = {operand({4}, 9),    operand({4}, 9), operand({3, 4}, 0),  operand({3}, 1),
                                  operand({2, 3}, 2), operand({2}, 3), operand({16, 5}, 4), operand({16, 4}, 5),
                                  operand({16}, 6),   operand({16}, 7)};
  std::string pickle = "ctorch\nFloatStorage\n", byteorder = "little";

  [[nodiscard]] std::string bytes() const {
    std::vector<ZipEntry> entries = {{"policy/data.pkl", pickle}, {"policy/byteorder", byteorder}};
    for (const auto& [name, text] : code) entries.push_back({"policy/code/__torch__/" + name, text});
    for (std::size_t k = 0; k < tensors.size(); ++k)
      entries.push_back(
          {"policy/data/" + std::to_string(k), std::string(reinterpret_cast<const char*>(tensors[k].values.data()),
                                                           tensors[k].values.size() * sizeof(float))});
    return zip_bytes(entries);
  }
  [[nodiscard]] std::string refusal() const {
    return thrown_message<InputError>([&] { (void)torch_script_network(bytes(), "policy.pt"); });
  }
};

double sigmoid(double x) { return 1.0 / (1.0 + std::exp(-x)); }

// The exporter's module in double: its memory, and W x + b of row `row`.
struct Reference {
  const std::vector<Operand>& tensors;
  std::vector<double> h, c;

  explicit Reference(const std::vector<Operand>& from)
      : tensors(from), h(from[0].values.size(), 0.0), c(from[0].values.size(), 0.0) {}

  [[nodiscard]] double row(int matrix, int bias, int row, const std::vector<double>& x) const {
    double sum = static_cast<double>(tensors[bias].values[row]);
    for (std::size_t k = 0; k < x.size(); ++k)
      sum += static_cast<double>(tensors[matrix].values[row * x.size() + k]) * x[k];
    return sum;
  }

  std::vector<double> act(const std::vector<float>& input) {
    const std::vector<double> x(input.begin(), input.end()), old = h;
    const int hidden = static_cast<int>(h.size()), first = static_cast<int>(tensors.size()) - 4;
    const auto gate = [&](int g, int k) {
      return row(first, first + 2, g * hidden + k, x) + row(first + 1, first + 3, g * hidden + k, old);
    };
    for (int k = 0; k < hidden; ++k) {
      c[k] = sigmoid(gate(1, k)) * c[k] + sigmoid(gate(0, k)) * std::tanh(gate(2, k));
      h[k] = sigmoid(gate(3, k)) * std::tanh(c[k]);
    }
    std::vector<double> value = h;
    for (int layer = 2; layer < first; layer += 2) {
      std::vector<double> next(tensors[layer + 1].values.size());
      for (std::size_t k = 0; k < next.size(); ++k) {
        next[k] = row(layer, layer + 1, static_cast<int>(k), value);
        if (layer + 2 < first && next[k] < 0) next[k] = std::expm1(next[k]);
      }
      value = next;
    }
    return value;
  }
};

void expect_steps(Network& network, const std::vector<Operand>& tensors, int inputs) {
  for (int episode = 0; episode < 2; ++episode) {
    Reference reference(tensors);
    for (int t = 0; t < 5; ++t) {
      std::vector<float> x = wave(inputs);
      for (float& value : x) value *= static_cast<float>(t + 1);
      const std::vector<double> expected = reference.act(x);
      const std::vector<float> found = evaluate(network, {x})[0];
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-5) << "step " << t;
    }
    network.reset();
  }
}

TEST(TorchScript, EqualsTheExportersFormulaOverStepsAndAfterReset) {
  const Export file;
  const auto network = torch_script_network(file.bytes(), "policy.pt");
  EXPECT_EQ(network->inputs()[0].size, 5);
  EXPECT_EQ(network->outputs()[0].size, 2);
  expect_steps(*network, file.tensors, 5);
}

TEST(TorchScript, UnitreesPolicyEqualsTheFormula) {
  const std::string path = shared_file("models/unitree_rl_gym_g1_motion.pt");
  if (path.empty()) GTEST_SKIP() << "not run: unitree_rl_gym_g1_motion.pt absent";
  std::vector<Operand> tensors(10);
  read_zip(read_file(path), path, {1 << 20, 1 << 20}, [&](const std::string& entry, const std::string& content) {
    const std::size_t at = entry.find("/data/");
    if (at == std::string::npos) return;
    std::vector<float>& values = tensors[std::stoi(entry.substr(at + 6))].values;
    values.resize(content.size() / sizeof(float));
    std::memcpy(values.data(), content.data(), content.size());
  });
  const auto network = load_network(path);
  EXPECT_EQ(network->inputs()[0].size, 47);
  EXPECT_EQ(network->outputs()[0].size, 12);
  expect_steps(*network, tensors, 47);
}

TEST(TorchScript, OtherKindsAreRefused) {
  const auto without = [](const std::string& name, const std::string& text, const std::string& instead = "") {
    Export file;
    std::string& code = file.code[name];
    code.replace(code.find(text), text.size(), instead);
    return file.refusal();
  };
  EXPECT_SENTENCE(without("helpers.py", "LSTM"));
  EXPECT_SENTENCE(without("rnn.py", "= 1", "= 2"));
  EXPECT_SENTENCE(without("rnn.py", "False", "True"));
  EXPECT_SENTENCE(without("activation.py", "1.", "0.5"));
  EXPECT_SENTENCE(without("container.py", "ELU", "Tanh"));
  EXPECT_SENTENCE(without("container.py", "ELU", "GELU"));
  EXPECT_SENTENCE(without("container.py", "[\"2\"]", "[\"4\"]"));
  Export longer;
  longer.code["container.py"] += "  __annotations__[\"3\"] = __torch__.torch.nn.modules.activation.Tanh\n";
  EXPECT_SENTENCE(longer.refusal());
  Export wide;
  wide.pickle = "ctorch\nDoubleStorage\n";
  EXPECT_SENTENCE(wide.refusal());
}

TEST(TorchScript, TensorsThatDoNotFitAreRefused) {
  const auto changed = [](std::size_t tensor, const Shape& shape) {
    Export file;
    file.tensors[tensor] = operand(shape);
    return file.refusal();
  };
  EXPECT_SENTENCE(changed(1, {3}));
  EXPECT_SENTENCE(changed(2, {11}));
  EXPECT_SENTENCE(changed(4, {7}));
  EXPECT_SENTENCE(changed(6, {81}));
  EXPECT_SENTENCE(changed(7, {63}));
  EXPECT_SENTENCE(changed(9, {15}));
  Export few;
  few.tensors.resize(7);
  EXPECT_SENTENCE(few.refusal());
  Export spoiled;
  spoiled.tensors[7].values[3] = std::nanf("");
  EXPECT_SENTENCE(spoiled.refusal());
}

TEST(TorchScript, ArchivesThatAreNotOnesAreRefused) {
  Export empty;
  empty.pickle.clear();
  EXPECT_SENTENCE(empty.refusal());
  Export big;
  big.byteorder = "big";
  EXPECT_SENTENCE(big.refusal());
  const auto refusal = [](const std::vector<ZipEntry>& entries) {
    return thrown_message<InputError>([&] { (void)torch_script_network(zip_bytes(entries), "policy.pt"); });
  };
  EXPECT_SENTENCE(refusal({{"p/data/x1", ""}}));
  EXPECT_SENTENCE(refusal({{"p/data/0", "123"}}));
}

}  // namespace
}  // namespace duet::test
