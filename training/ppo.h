// Proximal policy optimisation of WBC-Sim's oracle on all cores. Source: Schulman et al. 2017, arXiv:1707.06347; with
// generalised advantages, a learning rate steered by the divergence of the last minibatch, and the robot's symmetry
// (each sample is used as it is or mirrored). Reproducible from the seed for the same number of threads.
#pragma once

#include <memory>
#include <vector>

#include "duet/training/agent.h"
#include "duet/training/iteration_report.h"
#include "duet/training/mirror.h"
#include "duet/training/wbc_environment.h"

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

}  // namespace duet
