// A network of random weights: for tests and benchmarks, and what a trainer starts from.
#pragma once

#include <cstdint>

#include "duet/policies/dstar/network.h"

namespace duet {

// Weights normal with deviation 1 / sqrt(inputs), scales of norms about 1, biases and positions about 0; normalisers
// about one. Made for `robot` and the built-in language. Throws std::invalid_argument for a configuration that is
// refused by parse_dstar_config.
DstarNetwork random_dstar_network(const DstarConfig& config, const RobotModel& robot, std::uint64_t seed);

}  // namespace duet
