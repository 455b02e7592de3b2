#include "duet/nn/mlp_file.h"

#include <fmt/format.h>

#include "duet/core/require.h"

namespace duet {
namespace {

const Tensor& tensor(const SafeTensors& tensors, const std::string& name, const std::string& file) {
  const auto found = tensors.tensors.find(name);
  if (found == tensors.tensors.end()) throw InputError(fmt::format("{}: no tensor '{}'", file, name));
  return found->second;
}

MlpLayer read_layer(const SafeTensors& tensors, const std::string& name, Eigen::Index inputs, const std::string& file) {
  const Tensor& weight = tensor(tensors, name + ".weight", file);
  const Tensor& bias = tensor(tensors, name + ".bias", file);
  if (weight.shape.size() != 2 || (inputs > 0 && weight.shape[1] != inputs))
    throw InputError(fmt::format("{}: tensor '{}.weight' has shape ({}), expected (outputs, {})", file, name,
                                 fmt::join(weight.shape, ", "), inputs > 0 ? std::to_string(inputs) : "inputs"));
  if (bias.shape.size() != 1 || bias.shape[0] != weight.shape[0])
    throw InputError(fmt::format("{}: tensor '{}.bias' has shape ({}), expected ({})", file, name,
                                 fmt::join(bias.shape, ", "), weight.shape[0]));
  MlpLayer layer;
  layer.W = Eigen::Map<const decltype(layer.W)>(weight.values.data(), weight.shape[0], weight.shape[1]);
  layer.b = Eigen::Map<const Eigen::VectorXf>(bias.values.data(), bias.shape[0]);
  if (!layer.W.allFinite() || !layer.b.allFinite())
    throw InputError(fmt::format("{}: tensor '{}.weight' or its bias has values that are not finite", file, name));
  return layer;
}

}  // namespace

void add_mlp(SafeTensors& tensors, const std::string& prefix, const Mlp& mlp) {
  for (size_t i = 0; i < mlp.layers.size(); ++i) {
    const MlpLayer& layer = mlp.layers[i];
    const std::string name = fmt::format("{}.{}", prefix, i);
    tensors.tensors[name + ".weight"] = {.shape = {layer.W.rows(), layer.W.cols()},
                                         .values = {layer.W.data(), layer.W.data() + layer.W.size()}};
    tensors.tensors[name + ".bias"] = {.shape = {layer.b.size()},
                                       .values = {layer.b.data(), layer.b.data() + layer.b.size()}};
  }
}

Mlp read_mlp(const SafeTensors& tensors, const std::string& prefix, const std::string& file) {
  Mlp mlp;
  for (int i = 0; i == 0 || tensors.tensors.contains(fmt::format("{}.{}.weight", prefix, i)); ++i)
    mlp.layers.push_back(
        read_layer(tensors, fmt::format("{}.{}", prefix, i), i == 0 ? 0 : mlp.layers.back().W.rows(), file));
  return mlp;
}

}  // namespace duet
