#include "duet/training/checkpoint.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/core/require.h"

namespace duet {

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
