#include "duet/nn/catalogue/load_network.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/mlp.h"
#include "duet/nn/network.h"
#include "duet/nn/onnx/onnx_model.h"
#include "duet/nn/onnx/onnx_plan.h"
#include "duet/nn/torch/torch_archive.h"
#include "duet/nn/torch/torch_script.h"

namespace duet {
namespace {

class MlpNetwork final : public Network {
 public:
  explicit MlpNetwork(Mlp mlp)
      : mlp_(std::move(mlp)), runner_(mlp_), inputs_{{"input", mlp_.inputs()}}, outputs_{{"output", mlp_.outputs()}} {}

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    std::ranges::copy(runner_.run(inputs[0]), outputs[0].begin());
  }

 private:
  Mlp mlp_;
  MlpRunner runner_;
  std::vector<Port> inputs_, outputs_;
};

// The one perceptron that a file holds: "<prefix>.0.weight" names it.
Mlp one_mlp(const SafeTensors& content, const std::string& file) {
  constexpr std::string_view kFirst = ".0.weight";
  std::vector<std::string> prefixes;
  for (const auto& [name, tensor] : content.tensors)
    if (name.ends_with(kFirst)) prefixes.push_back(name.substr(0, name.size() - kFirst.size()));
  if (prefixes.size() != 1)
    throw InputError(fmt::format("'{}': expected one multilayer perceptron ('<name>.0.weight'), found {} [{}]", file,
                                 prefixes.size(), excerpt(fmt::format("{}", fmt::join(prefixes, ", ")))));
  return read_mlp(content, prefixes[0], file);
}

bool is_zip(std::string_view bytes) { return bytes.starts_with("PK"); }

// Weights that a training saved say nothing of the network that they belong to.
[[noreturn]] void refuse_checkpoint(const std::string& path, std::string_view what) {
  throw InputError(fmt::format(
      "'{}': this is {}, a training checkpoint: it holds weights and says nothing of the network; export the "
      "network itself to ONNX (torch.onnx.export) or TorchScript (torch.jit.script)",
      path, what));
}

// Refuses a file of weights alone, told by its first bytes or by the names in its directory.
void check_is_network(std::string_view bytes, const std::string& path) {
  if (bytes.starts_with('\x80')) refuse_checkpoint(path, "a pickle");
  if (bytes.starts_with("\x89HDF")) refuse_checkpoint(path, "an HDF5 file");
  if (is_zip(bytes) && !holds_torch_code(bytes, path)) refuse_checkpoint(path, "a file of torch.save or of NumPy");
}

// A header length that fits and a brace: no ONNX model begins so.
bool is_safetensors(std::string_view bytes) {
  std::uint64_t length = 0;
  if (bytes.size() <= sizeof length) return false;
  std::memcpy(&length, bytes.data(), sizeof length);
  return bytes[sizeof length] == '{' && length <= (std::uint64_t{1} << 32);
}

std::string folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder.string();
}

}  // namespace

std::vector<std::string> network_engines() {
  std::vector<std::string> engines = {"duet"};
  if (libtorch_built_in()) engines.emplace_back("libtorch");
  return engines;
}

std::unique_ptr<Network> load_network(const std::string& path, const std::string& engine) {
  return load_network_file(path, engine).make();
}

NetworkFile load_network_file(const std::string& path, const std::string& engine) {
  const std::vector<std::string> engines = network_engines();
  require(std::ranges::find(engines, engine) != engines.end(), "no network engine '{}' in this build. It has: {}",
          engine, fmt::join(engines, ", "));
  require_data(path);
  const std::string bytes = read_data(path);
  if (engine == "libtorch") return {[bytes, path] { return libtorch_network(bytes, path); }};
  check_is_network(bytes, path);
  if (is_zip(bytes)) return {torch_script_maker(bytes, path)};
  if (is_safetensors(bytes)) {
    return {[mlp = one_mlp(parse_safetensors(bytes, path), path)] { return std::make_unique<MlpNetwork>(mlp); }};
  }
  const auto graph = std::make_shared<const OnnxGraph>(parse_onnx(bytes, path, folder_of(path)));
  return {[graph] { return onnx_network(*graph); }, graph->metadata};
}

LoadedFiles network_files(const std::string& path) {
  const std::string bytes = read_data(path), folder = folder_of(path);
  LoadedFiles files = {{"network", path}};
  if (is_zip(bytes) || is_safetensors(bytes)) return files;
  for (const std::string& location : external_locations(bytes))
    if (location_fault(folder, location).empty())
      files.push_back({"network data " + location, (std::filesystem::path(folder) / location).string()});
  return files;
}

}  // namespace duet
