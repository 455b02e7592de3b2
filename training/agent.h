// The agent that PPO trains: the oracle's networks and their normalisers. Value type, and how it is kept in a file.
#pragma once

#include <cstdint>
#include <string>

#include "duet/nn/mlp_file.h"
#include "duet/training/batch_mlp.h"
#include "duet/training/normaliser.h"

namespace duet {

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

}  // namespace duet
