#include "training/checkpoint.h"

#include <fmt/format.h>

#include <cmath>

#include "core/require.h"

namespace duet {
namespace {

const Tensor& tensor(const SafeTensors& tensors, const std::string& name, const std::string& file) {
  const auto found = tensors.tensors.find(name);
  if (found == tensors.tensors.end())
    throw InputError(fmt::format("{}: no tensor '{}': not a checkpoint of this training", file, name));
  return found->second;
}

}  // namespace

Tensor tensor_of(const Eigen::Ref<const Eigen::VectorXf>& values) {
  return {.shape = {values.size()}, .values = {values.data(), values.data() + values.size()}};
}

Eigen::VectorXf vector_of(const SafeTensors& tensors, const std::string& name, Eigen::Index size,
                          const std::string& file) {
  const Tensor& found = tensor(tensors, name, file);
  if (static_cast<Eigen::Index>(found.values.size()) != size)
    throw InputError(fmt::format("{}: tensor '{}' has {} values, expected {}", file, name, found.values.size(), size));
  return Eigen::Map<const Eigen::VectorXf>(found.values.data(), size);
}

std::string text_of(const SafeTensors& tensors, const std::string& key, const std::string& file) {
  const auto found = tensors.metadata.find(key);
  if (found == tensors.metadata.end())
    throw InputError(fmt::format("{}: no '{}' in the header: not a checkpoint of this training", file, key));
  return found->second;
}

double number_of(const SafeTensors& tensors, const std::string& key, const std::string& file) {
  const std::string value = text_of(tensors, key, file);
  try {
    return std::stod(value);
  } catch (const std::exception&) {
    throw InputError(fmt::format("{}: '{}' in the header is '{}', expected a number", file, key, value));
  }
}

void add_normaliser(SafeTensors& tensors, const std::string& prefix, const Normaliser& normaliser) {
  tensors.tensors[prefix + ".mean"] = tensor_of(normaliser.mean);
  tensors.tensors[prefix + ".variance"] = tensor_of(normaliser.variance);
  tensors.metadata[prefix + ".count"] = fmt::format("{}", normaliser.count);
}

Normaliser normaliser_of(const SafeTensors& tensors, const std::string& prefix, int size, const std::string& file) {
  Normaliser normaliser(size);
  normaliser.mean = vector_of(tensors, prefix + ".mean", size, file);
  normaliser.variance = vector_of(tensors, prefix + ".variance", size, file);
  normaliser.count = number_of(tensors, prefix + ".count", file);
  return normaliser;
}

void check_format(const SafeTensors& tensors, const std::string& format, const std::string& file) {
  const std::string found = text_of(tensors, "format", file);
  if (found != format) throw InputError(fmt::format("{}: the format is '{}', expected '{}'", file, found, format));
}

void add_adam(SafeTensors& tensors, const Adam& adam) {
  for (size_t i = 0; i < adam.m.size(); ++i) {
    tensors.tensors[fmt::format("adam.{:02}.m", i)] = tensor_of(adam.m[i]);
    tensors.tensors[fmt::format("adam.{:02}.v", i)] = tensor_of(adam.v[i]);
  }
  tensors.metadata["adam.steps"] = std::to_string(adam.steps);
}

Adam adam_of(const SafeTensors& tensors, const std::vector<Eigen::Map<Eigen::VectorXf>>& parameters,
             const std::string& file) {
  Adam adam;
  adam.steps = std::lround(number_of(tensors, "adam.steps", file));
  for (size_t i = 0; adam.steps > 0 && i < parameters.size(); ++i) {
    adam.m.push_back(vector_of(tensors, fmt::format("adam.{:02}.m", i), parameters[i].size(), file));
    adam.v.push_back(vector_of(tensors, fmt::format("adam.{:02}.v", i), parameters[i].size(), file));
  }
  return adam;
}

}  // namespace duet
