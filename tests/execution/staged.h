// Experiments over clips that a test makes.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "duet/execution/experiment.h"

namespace duet::test {

inline std::shared_ptr<Experiment> experiment_of(Suite suite, std::vector<PairedMotion> clips) {
  auto experiment = std::make_shared<Experiment>(std::move(suite));
  experiment->take_clips(std::move(clips));
  return experiment;
}

// Its first episode, with a seed that depends on no name.
inline EpisodeSpec first_of(const Experiment& experiment, std::uint64_t seed = 1) {
  EpisodeSpec spec = experiment.at(0);
  spec.seed = seed;
  spec.perturbation_seed = 0;
  return spec;
}

}  // namespace duet::test
