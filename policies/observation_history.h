// The last kHistoryFrames frames that a policy sees, the first one repeated until there are as many. One owner, not
// thread-safe.
#pragma once

#include <Eigen/Core>
#include <array>

#include "duet/policies/policy.h"

namespace duet {

class ObservationHistory {
 public:
  void reset() { empty_ = true; }
  // The frame of the current tick.
  void add(const ObservationFrame& frame);
  // Refers to this history: valid until the next add. Throws std::invalid_argument before the first add.
  [[nodiscard]] Observation at(int tick) const;

 private:
  std::array<ObservationFrame, kHistoryFrames> frames_;  // oldest first
  bool empty_ = true;
};

// The network's view of a history: to_vector of each frame, (149, kHistoryFrames) for 29 joints, oldest first.
Eigen::MatrixXd to_matrix(const Observation& observation, const Eigen::Vector3d& start_position);

}  // namespace duet
