// Whether a network is one: private to policies/dstar/.
#pragma once

#include <string>

#include "duet/policies/dstar/network.h"

namespace duet {

// The first thing that is wrong with its configuration, names, normalisers or tensors ("tensor 'x': expected shape (3),
// found (4)"); "" where it can be evaluated.
std::string network_problem(const DstarNetwork& network);

std::string shape_words(const std::vector<std::int64_t>& shape);

}  // namespace duet
