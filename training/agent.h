// The agent that PPO trains: the oracle's networks and their normalisers. Value type, and how it is kept in a file.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "duet/nn/mlp.h"
#include "duet/nn/safetensors.h"

namespace duet {

// A multilayer perceptron in training: batches forward and backward, and Adam over all of its numbers. In float, on the
// dense kernels of nn/. Columns are samples. One workspace per thread; the network is shared and read-only meanwhile.

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

// Running mean and variance of a network's inputs. In float, as the network.

inline constexpr double kLongestMemory = 4e6;  // samples: what the first poses looked like must not weigh for ever

struct Normaliser {
  Eigen::VectorXf mean, variance;
  double count = 1e-2;

  explicit Normaliser(int size = 0) : mean(Eigen::VectorXf::Zero(size)), variance(Eigen::VectorXf::Ones(size)) {}
  void update(const Eigen::MatrixXf& x);  // columns are samples
  void merge(const Normaliser& other);    // as if its samples had been given here
  // (x - mean) / deviation, clipped to +-kNormalClip, in place.
  void apply(Eigen::MatrixXf& x) const;
  [[nodiscard]] Eigen::VectorXf deviation() const;  // never below 1e-2
  void set_deviation(const Eigen::VectorXf& deviation);
};

struct WbcAgent {
  Mlp actor, critic;
  Eigen::VectorXf log_std;
  Normaliser actor_input, critic_input;
};

// 512-256-128 networks (A.3.2) with weights from the seed.
WbcAgent make_agent(int actor_inputs, int critic_inputs, int actions, double std, std::uint64_t seed);

// Where a training stands; with the agent all that is needed to go on.
struct TrainingState {
  WbcAgent agent;
  Adam adam;
  double rate = 3e-4;
  long iteration = 0, steps = 0;
  long critic_alone = 0;  // iterations at the beginning in which only the critic learns: it is newer than the actor
  double minutes = 0.0;   // of training so far
  std::string stage, robot_digest;
  std::uint64_t seed = 0;
};

// Throws InputError for a file that is no such checkpoint (what is missing or has another shape, by name).
SafeTensors to_tensors(const TrainingState& state);
TrainingState training_state(const SafeTensors& tensors, const std::string& file);

// Parts that checkpoints of all trainings share: normalisers and Adam's moments among the tensors of a file. Reading
// throws InputError naming the file, what is missing or what has another size.

void add_normaliser(SafeTensors& tensors, const std::string& prefix, const Normaliser& normaliser);
Normaliser normaliser_of(const SafeTensors& tensors, const std::string& prefix, int size, const std::string& file);

// `parameters`: what is being learnt, in order; the moments have their sizes.
void add_adam(SafeTensors& tensors, const Adam& adam);
Adam adam_of(const SafeTensors& tensors, const std::vector<Eigen::Map<Eigen::VectorXf>>& parameters,
             const std::string& file);

}  // namespace duet
