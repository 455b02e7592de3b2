// The library of `retrieval`: windows of demonstrations as they are.
#pragma once

#include "duet/policies/dstar/retrieval.h"
#include "duet/training/dstar/windows.h"

namespace duet {

// `windows` of them, drawn evenly from the set. Throws std::invalid_argument for a set without a window.
RetrievalLibrary make_retrieval_library(const std::shared_ptr<const RobotModel>& robot, const DemonstrationSet& set,
                                        int windows, std::uint64_t seed);

}  // namespace duet
