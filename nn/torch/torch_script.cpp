#include "duet/nn/torch/torch_script.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "duet/nn/dense_kernels.h"
#include "duet/nn/mlp.h"
#include "duet/nn/onnx/onnx_plan.h"
#include "duet/nn/torch/torch_archive.h"

namespace duet {
namespace {

struct Module {
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W, R;
  Eigen::VectorXf b;
  Mlp actor;
};

class LstmReader {
 public:
  explicit LstmReader(const TorchArchive& archive) : archive_(archive) {
    for (const auto& [path, source] : archive.sources) code_ += source + "\n";
  }

  // Whether the archive's own code says so.
  [[nodiscard]] bool is_one() const { return says("class PolicyExporterLSTM(Module)"); }

  [[nodiscard]] Module read() const {
    check_kind();
    return module();
  }

 private:
  [[noreturn]] void refuse_kind(const std::string& found) const {
    archive_.refuse(
        fmt::format("expected a PolicyExporterLSTM with one LSTM layer and ELU between linear layers, found {} "
                    "(TorchScript of another kind; needs libtorch)",
                    found));
  }

  [[nodiscard]] bool says(const std::string& text) const { return code_.find(text) != std::string::npos; }

  void check_kind() const {
    for (const char* line : {"num_layers : Final[int] = 1\n", "bidirectional : Final[bool] = False\n",
                             "proj_size : Final[int] = 0\n", "alpha : Final[float] = 1.\n"})
      if (!says(line))
        refuse_kind(fmt::format("no line '{}'", std::string_view(line).substr(0, std::strlen(line) - 1)));
    for (std::size_t at = archive_.pickle.find("Storage"); at != std::string::npos;
         at = archive_.pickle.find("Storage", at + 1))
      if (at < 5 || archive_.pickle.compare(at - 5, 5, "Float") != 0) refuse_kind("tensors that are not float");
  }

  // Linear, ELU, Linear, ...: 2 layers - 1 modules.
  void check_actor(int layers) const {
    const auto annotation = [](int k) {
      return fmt::format("__annotations__[\"{}\"] = __torch__.torch.nn.modules.", k);
    };
    for (int k = 0; k < 2 * layers - 1; ++k) {
      const std::size_t at = code_.find(annotation(k));
      if (at == std::string::npos) refuse_kind(fmt::format("no module {} in its actor", k));
      const std::size_t begin = at + annotation(k).size();
      const std::string_view kind = std::string_view(code_).substr(begin, code_.find('\n', begin) - begin);
      const bool fits =
          k % 2 == 0 ? kind.starts_with("linear.") : kind.starts_with("activation.") && kind.ends_with("ELU");
      if (!fits || (k % 2 == 1 && kind.ends_with("GELU")))
        refuse_kind(fmt::format("'{}' as module {} of its actor", kind, k));
    }
    if (says(annotation(2 * layers - 1))) refuse_kind(fmt::format("more than {} modules in its actor", 2 * layers - 1));
  }

  // Tensors by number, as the exporter's members stand: hidden state, cell state, each linear layer's weight and bias,
  // the LSTM's two matrices and two biases. Their sizes give all shapes.
  [[nodiscard]] Module module() const {
    const int count = static_cast<int>(archive_.tensors.size());
    constexpr int kStates = 2, kLstm = 4;
    const int layers = (count - kStates - kLstm) / 2;
    if (count < kStates + 2 + kLstm || count % 2 != 0 || archive_.tensors.rbegin()->first != count - 1)
      archive_.refuse(fmt::format("expected tensors 0 to 2 n + 5, found {} tensors", count));
    check_actor(layers);
    Module module;
    const int hidden = static_cast<int>(archive_.tensors.at(0).size());
    check(hidden > 0 && archive_.tensors.at(1).size() == archive_.tensors.at(0).size(), 1);
    int inputs = hidden;
    for (int k = 0; k < layers; ++k) {
      module.actor.layers.push_back(layer(kStates + 2 * k, inputs));
      inputs = static_cast<int>(module.actor.layers.back().b.size());
    }
    read_lstm(kStates + 2 * layers, hidden, module);
    return module;
  }

  void check(bool condition, int tensor) const {
    if (!condition)
      archive_.refuse(fmt::format("tensor 'data/{}': its {} numbers do not fit the other tensors", tensor,
                                  archive_.tensors.at(tensor).size()));
  }

  [[nodiscard]] MlpLayer layer(int first, int inputs) const {
    const std::vector<float>&W = archive_.finite(first), &b = archive_.finite(first + 1);
    check(!b.empty() && W.size() == b.size() * inputs, first);
    MlpLayer layer;
    layer.b = Eigen::Map<const Eigen::VectorXf>(b.data(), static_cast<Eigen::Index>(b.size()));
    layer.W = Eigen::Map<const decltype(layer.W)>(W.data(), layer.b.size(), inputs);
    return layer;
  }

  void read_lstm(int first, int hidden, Module& module) const {
    const auto tensor = [&](int k) -> const std::vector<float>& { return archive_.finite(first + k); };
    const std::size_t rows = 4 * static_cast<std::size_t>(hidden);
    check(!tensor(0).empty() && tensor(0).size() % rows == 0, first);
    check(tensor(1).size() == rows * hidden, first + 1);
    check(tensor(2).size() == rows, first + 2);
    check(tensor(3).size() == rows, first + 3);
    const auto inputs = static_cast<Eigen::Index>(tensor(0).size() / rows);
    const auto gates = static_cast<Eigen::Index>(rows);
    module.W = Eigen::Map<const decltype(module.W)>(tensor(0).data(), gates, inputs);
    module.R = Eigen::Map<const decltype(module.R)>(tensor(1).data(), gates, hidden);
    module.b = Eigen::Map<const Eigen::VectorXf>(tensor(2).data(), gates) +
               Eigen::Map<const Eigen::VectorXf>(tensor(3).data(), gates);
  }

  const TorchArchive& archive_;
  std::string code_;  // of all classes
};

class LstmPolicy final : public Network {
 public:
  explicit LstmPolicy(Module module)
      : module_(std::move(module)),
        actor_(module_.actor),
        h_(Eigen::VectorXf::Zero(module_.R.cols())),
        c_(h_),
        scratch_(8 * h_.size()),
        inputs_{{"x", static_cast<int>(module_.W.cols())}},
        outputs_{{"action", module_.actor.outputs()}} {}

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    const LstmCell cell{.inputs = inputs_[0].size,
                        .hidden = static_cast<int>(h_.size()),
                        .W = module_.W.data(),
                        .R = module_.R.data(),
                        .b = module_.b.data(),
                        .order = kTorchLstmOrder};
    lstm_step(cell, inputs[0].data(), h_.data(), c_.data(), scratch_.data());
    std::ranges::copy(actor_.run({h_.data(), static_cast<std::size_t>(h_.size())}), outputs[0].begin());
  }

  void reset() override {
    h_.setZero();
    c_.setZero();
  }

 private:
  Module module_;
  MlpRunner actor_;
  Eigen::VectorXf h_, c_, scratch_;
  std::vector<Port> inputs_, outputs_;
};

// A network whose first input and output are its own, while the others are its memory: what comes out of each goes in
// at the next evaluation.
class RememberingNetwork final : public Network {
 public:
  explicit RememberingNetwork(std::unique_ptr<Network> network)
      : network_(std::move(network)), inputs_{network_->inputs()[0]}, outputs_{network_->outputs()[0]} {
    for (const Port& port : network_->inputs().subspan(1)) memory_.emplace_back(port.size, 0.0F);
    next_ = memory_;
  }

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    in_.assign({inputs[0]});
    out_.assign({outputs[0]});
    for (const std::vector<float>& state : memory_) in_.emplace_back(state);
    for (std::vector<float>& state : next_) out_.emplace_back(state);
    network_->run(in_, out_);
    std::swap(memory_, next_);
  }

  void reset() override {
    for (std::vector<float>& state : memory_) std::ranges::fill(state, 0.0F);
  }

 private:
  std::unique_ptr<Network> network_;
  std::vector<Port> inputs_, outputs_;
  std::vector<std::vector<float>> memory_, next_;
  std::vector<std::span<const float>> in_;  // kept: nothing allocates after the first run
  std::vector<std::span<float>> out_;
};

}  // namespace

std::function<std::unique_ptr<Network>()> torch_script_maker(std::string_view bytes, const std::string& file) {
  const TorchArchive archive = read_torch_archive(bytes, file);
  const LstmReader lstm(archive);
  if (lstm.is_one()) return [module = lstm.read()] { return std::make_unique<LstmPolicy>(module); };
  return [graph = torch_graph(archive)]() -> std::unique_ptr<Network> {
    if (graph.states.empty()) return onnx_network(graph.graph);
    return std::make_unique<RememberingNetwork>(onnx_network(graph.graph));
  };
}

std::unique_ptr<Network> torch_script_network(std::string_view bytes, const std::string& file) {
  return torch_script_maker(bytes, file)();
}

}  // namespace duet
