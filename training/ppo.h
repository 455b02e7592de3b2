// Proximal policy optimisation of WBC-Sim's oracle on all cores. Source: Schulman et al. 2017, arXiv:1707.06347; with
// generalised advantages, a learning rate steered by the divergence of the last minibatch, and the robot's symmetry
// (each sample is used as it is or mirrored). Reproducible from the seed for the same number of threads.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "duet/training/agent.h"
#include "duet/training/wbc_environment.h"
#include "duet/training/wbc_task.h"

namespace duet {

struct PpoOptions {
  int threads = 2;
  int environments = 128;  // a multiple of threads; so few that their engines stay in the cache
  int horizon = 64;        // ticks per environment and iteration
  int epochs = 3, minibatches = 4;
  double clip = 0.2, discount = 0.99, lambda = 0.95;  // A.3.2
  double entropy = 0.002;
  double rate_low = 5e-5, rate_high = 1e-3;
  double divergence_low = 0.012, divergence_high = 0.03;
  double mirror_pull = 0.3;  // of the mean towards the mirrored one's, in 1/sigma^2
  double least_std = 0.05, largest_std = 1.0;
};

class Ppo {
 public:
  // Throws std::invalid_argument for options out of range and a state of another robot's sizes.
  Ppo(const std::shared_ptr<const RobotModel>& robot, const WbcTask& task, const PpoOptions& options,
      TrainingState state);
  ~Ppo();  // where Worker and Batch are complete
  IterationReport iterate();
  [[nodiscard]] const TrainingState& state() const { return state_; }

 private:
  struct Batch;   // samples of one iteration
  struct Worker;  // a thread's networks, environments and sums
  void collect(int thread, Batch& batch);
  void look(Worker& worker) const;                             // at all environments, as they are and mirrored
  void decide(Worker& worker, int first, Batch& batch) const;  // actions of a tick from column `first` on
  void step(Worker& worker, int first, Batch& batch) const;
  void advantages(int thread, Batch& batch);
  double learn(Batch& batch);  // the divergence of the last minibatch
  IterationReport summary();
  double minibatch(const std::vector<int>& order, const std::vector<std::uint8_t>& mirrored, int begin, int size,
                   Batch& batch);
  double gradients(int thread, std::span<const int> samples, const std::vector<std::uint8_t>& mirrored, int size,
                   Batch& batch);
  double differentiate_policy(Worker& worker, std::span<const int> samples, const std::vector<std::uint8_t>& mirrored,
                              float share, Batch& batch) const;
  void apply_gradients();
  void steer(double divergence);
  [[nodiscard]] bool critic_alone() const { return state_.iteration < state_.critic_alone; }

  PpoOptions options_;
  TrainingState state_;
  Mirror actor_mirror_, critic_mirror_, action_mirror_;
  std::vector<std::unique_ptr<Worker>> workers_;
  std::unique_ptr<Batch> batch_;
};

// The pure sums of proximal policy optimisation: how likely an action was, how the clipped objective and the likelihood
// change with the policy, and what a step was worth. Source: Schulman et al., arXiv:1707.06347 (the objective) and
// arXiv:1506.02438 (the advantages).

// Log-probability of an action under independent normal distributions, up to a constant. `action` and `mean` have as
// many numbers as `inverse_std`; `sum_log_std` is the sum of the logarithms of the standard deviations.
float log_probability(const Eigen::VectorXf& inverse_std, float sum_log_std, const float* action, const float* mean);

// How the log-probability of one number of an action changes with its mean and with the logarithm of its standard
// deviation. Beyond four standard deviations it changes no faster than there.
struct LikelihoodGradient {
  float z = 0.0F;        // standard deviations from the mean; times inverse_std it is the derivative by the mean
  float log_std = 0.0F;  // derivative by the logarithm of the standard deviation
};
LikelihoodGradient likelihood_gradient(float action, float mean, float inverse_std);

// Derivative of -min(r A, clamp(r, 1 - clip, 1 + clip) A) by log r: 0 where the minimum is the clipped one.
float ratio_gradient(float log_ratio, float advantage, float clip);

struct StepWorth {
  float reward = 0.0F;
  float value = 0.0F;  // that the critic gave the state before the step
  bool ends = false;   // the episode; what follows belongs to another
};

// Generalised advantages of consecutive steps of one environment; `last_value` is the critic's of the state after them.
std::vector<float> generalised_advantages(std::span<const StepWorth> steps, float last_value, double discount,
                                          double lambda);

}  // namespace duet
