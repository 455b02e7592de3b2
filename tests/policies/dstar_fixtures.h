// A small D-STAR, seeded inputs for it, and the same network evaluated plainly in double precision.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "duet/policies/dstar/network.h"
#include "tests/policies/fixtures.h"

namespace duet::test {

// Every size different from the others, so that none can stand for another.
inline DstarConfig small_config() {
  DstarConfig config;
  config.long_frames = 11, config.short_frames = 5, config.long_stride = 3;
  config.width = 16, config.heads = 2, config.feedforward = 26, config.layers = 2;
  config.stream = 20, config.temporal = 18, config.tokens = 3, config.phase_hidden = 7, config.phase = 13;
  config.zone = 4, config.orientation = 5, config.field = 8, config.field_hidden = 10, config.fusion_heads = 4;
  config.spatial = 9, config.language = 14, config.condition = 17;
  config.channels = 24, config.blocks = 2, config.groups = 3, config.step_embedding = 6;
  config.training_steps = 40, config.inference_steps = 7;
  return config;
}

inline std::shared_ptr<const DstarNetwork> random_network(const DstarConfig& config, std::uint64_t seed = 1) {
  return std::make_shared<const DstarNetwork>(random_dstar_network(config, *g1(), seed));
}

struct DstarSample {
  DstarFeatures features;
  std::vector<float> language, noise;
  [[nodiscard]] DstarInput input() const { return {.features = &features, .language = language, .noise = noise}; }
};

// A sample with distances in every zone, one frame far outside the normaliser's range.
DstarSample random_sample(const DstarConfig& config, std::uint64_t seed);

struct DstarExpected {
  Eigen::VectorXd phases;           // empty without phase attention
  Eigen::VectorXd normalised_plan;  // 180
  Eigen::VectorXd plan;
};
DstarExpected evaluate_plainly(const DstarNetwork& network, const DstarSample& sample);

}  // namespace duet::test
