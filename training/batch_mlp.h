// A multilayer perceptron in training: batches forward and backward, and Adam over all of its numbers. In float, on the
// dense kernels of nn/. Columns are samples. One workspace per thread; the network is shared and read-only meanwhile.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/nn/mlp.h"

namespace duet {

// Gradients in the shape of the network.
using MlpGradient = std::vector<MlpLayer>;

class BatchMlp {
 public:
  explicit BatchMlp(const Mlp& mlp);  // keeps a reference

  // Outputs for inputs in columns; valid until the next call.
  const Eigen::MatrixXf& forward(const Eigen::MatrixXf& x);
  // Gradients of a loss whose derivative by the last outputs is `d`; overwrites gradient().
  void backward(const Eigen::MatrixXf& d);
  [[nodiscard]] MlpGradient& gradient() { return gradient_; }

 private:
  const Mlp& mlp_;
  std::vector<Eigen::MatrixXf> values_;  // input, then after each layer
  std::vector<Eigen::MatrixXf> deltas_;
  MlpGradient gradient_;
};

// One sample of a batch.
inline std::span<float> column(Eigen::MatrixXf& batch, int sample) {
  return {batch.col(sample).data(), static_cast<std::size_t>(batch.rows())};
}

// Views of all weights and biases, in order, as flat vectors.
std::vector<Eigen::Map<Eigen::VectorXf>> flat_views(std::vector<MlpLayer>& layers);

// Adam (beta 0.9, 0.999) over a list of vectors, the gradient clipped to a norm.
struct Adam {
  std::vector<Eigen::VectorXf> m, v;
  long steps = 0;

  void step(std::vector<Eigen::Map<Eigen::VectorXf>>& parameters, std::vector<Eigen::Map<Eigen::VectorXf>>& gradients,
            double rate, double largest_norm);
};

}  // namespace duet
