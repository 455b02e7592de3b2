// The report of one iteration of a training of WBC-Sim: of the oracle's PPO and of the student's distillation.
#pragma once

#include "duet/training/wbc_environment.h"

namespace duet {

struct IterationReport {
  long iteration = 0, steps = 0;  // of the environment, from the training's beginning
  int episodes = 0, falls = 0;
  double episode_seconds = 0.0, episode_return = 0.0;  // oracle: mean over the episodes that ended
  double rate = 0.0;                                   // of learning
  double divergence = 0.0, std = 0.0;                  // oracle
  double loss = 0.0;                                   // student: mean squared difference of an action
  TrackingStatistics tracking;
};

}  // namespace duet
