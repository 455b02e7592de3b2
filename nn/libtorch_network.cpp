// Any TorchScript module of one tensor to one tensor through libtorch, on one thread. It allocates at every evaluation.
#include <ATen/Parallel.h>
#include <fmt/format.h>
#include <torch/script.h>

#include <algorithm>
#include <sstream>

#include "duet/core/require.h"
#include "duet/nn/network.h"

namespace duet {
namespace {

// TorchScript does not say how many numbers a module takes: the columns of its recurrent layer's matrix or, without
// one, of its first matrix do.
int input_size(const torch::jit::Module& module, const std::string& file) {
  int size = 0;
  for (const auto& parameter : module.named_parameters()) {
    if (parameter.value.dim() != 2) continue;
    const bool recurrent = parameter.name.ends_with("weight_ih_l0");
    if (size == 0 || recurrent) size = static_cast<int>(parameter.value.size(1));
    if (recurrent) break;
  }
  if (size == 0) throw InputError(fmt::format("'{}': expected a module with a matrix, found none", file));
  return size;
}

class LibtorchNetwork final : public Network {
 public:
  LibtorchNetwork(std::istream& bytes, const std::string& path) : module_(torch::jit::load(bytes)) {
    at::set_num_threads(1);
    module_.eval();
    inputs_ = {{"x", input_size(module_, path)}};
    outputs_ = {{"action", static_cast<int>(evaluate(torch::zeros({1, inputs_[0].size})).numel())}};
    reset();
  }

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    torch::Tensor x = torch::empty({1, inputs_[0].size});
    std::copy_n(inputs[0].data(), inputs_[0].size, x.data_ptr<float>());
    const torch::Tensor y = evaluate(x);
    std::copy_n(y.data_ptr<float>(), outputs_[0].size, outputs[0].data());
  }

  void reset() override {
    if (module_.find_method("reset_memory")) module_.run_method("reset_memory");
  }

 private:
  torch::Tensor evaluate(const torch::Tensor& x) {
    const torch::NoGradGuard no_gradients;
    return module_.forward({x}).toTensor().to(torch::kFloat32).contiguous();
  }

  torch::jit::Module module_;
  std::vector<Port> inputs_, outputs_;
};

}  // namespace

bool libtorch_built_in() { return true; }

std::unique_ptr<Network> libtorch_network(const std::string& bytes, const std::string& path) {
  try {
    std::istringstream stream(bytes);
    return std::make_unique<LibtorchNetwork>(stream, path);
  } catch (const c10::Error& error) {
    throw InputError(fmt::format("'{}': libtorch: {}", path, error.what_without_backtrace()));
  }
}

}  // namespace duet
