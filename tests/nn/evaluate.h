// Shared by the tests of networks: a fixed input and one evaluation.
#pragma once

#include <cmath>
#include <vector>

#include "duet/nn/network.h"

namespace duet::test {

// The input that reference values were made with.
inline std::vector<float> wave(int size) {
  std::vector<float> x(size);
  for (int i = 0; i < size; ++i) x[i] = static_cast<float>(0.3 * std::sin(0.7 * i + 0.1));
  return x;
}

inline std::vector<std::vector<float>> evaluate(Network& network, const std::vector<std::vector<float>>& inputs) {
  std::vector<std::vector<float>> results;
  for (const Port& port : network.outputs()) results.emplace_back(port.size);
  const std::vector<std::span<const float>> in(inputs.begin(), inputs.end());
  const std::vector<std::span<float>> out(results.begin(), results.end());
  network.run(in, out);
  return results;
}

}  // namespace duet::test
