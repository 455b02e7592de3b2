// A multilayer perceptron with ELU between its layers, in float: weights as values, evaluated at batch 1 without
// allocation. WBC-Sim's oracle and student are such networks.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/nn/safetensors.h"

namespace duet {

struct MlpLayer {
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W;  // (out, in)
  Eigen::VectorXf b;
};

struct Mlp {
  std::vector<MlpLayer> layers;

  [[nodiscard]] int inputs() const { return layers.empty() ? 0 : static_cast<int>(layers.front().W.cols()); }
  [[nodiscard]] int outputs() const { return layers.empty() ? 0 : static_cast<int>(layers.back().W.rows()); }
  [[nodiscard]] std::vector<int> sizes() const;  // inputs, each layer's outputs
};

// Weights normal with deviation 1.3 / sqrt(inputs) (the last layer: output_scale / sqrt(inputs)), biases 0.
Mlp random_mlp(const std::vector<int>& sizes, float output_scale, Random& random);

// Evaluates one network again and again; keeps a reference to it. Weights that half precision holds exactly (those of a
// file in F16) are kept so: what limits batch 1 is reading them. No allocation after construction.
class MlpRunner {
 public:
  explicit MlpRunner(const Mlp& mlp);
  // The result stays valid until the next call.
  std::span<const float> run(std::span<const float> input);

 private:
  struct Layer {
    std::vector<std::uint16_t> half;  // W in the order of half_index; empty where W is not exact in half precision
    int columns = 0;                  // of W or of `half`
    Eigen::VectorXf value;            // the layer's result, filled up with zeros for the next one
  };
  const Mlp& mlp_;
  Eigen::VectorXf input_;
  std::vector<Layer> layers_;
};

// Multilayer perceptrons among the tensors of a file: `<prefix>.<layer>.weight` (out, in) and `<prefix>.<layer>.bias`.

void add_mlp(SafeTensors& tensors, const std::string& prefix, const Mlp& mlp);

// Throws InputError (file, tensor, expected, found): no layer 0, a missing bias, shapes that do not fit one another,
// weights that are not finite.
Mlp read_mlp(const SafeTensors& tensors, const std::string& prefix, const std::string& file);

}  // namespace duet
