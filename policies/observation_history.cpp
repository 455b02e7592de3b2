#include "duet/policies/observation_history.h"

#include <algorithm>

#include "duet/core/require.h"

namespace duet {

void ObservationHistory::add(const ObservationFrame& frame) {
  if (empty_) {
    frames_.fill(frame);
    empty_ = false;
    return;
  }
  std::rotate(frames_.begin(), frames_.begin() + 1, frames_.end());
  frames_.back() = frame;
}

Observation ObservationHistory::at(int tick) const {
  require(!empty_, "observation history: no frame was added yet");
  return {frames_, tick};
}

Eigen::MatrixXd to_matrix(const Observation& observation, const Eigen::Vector3d& start_position) {
  require(!observation.history.empty(), "observation: expected a history, found none");
  Eigen::MatrixXd matrix;
  for (std::size_t i = 0; i < observation.history.size(); ++i) {
    const Eigen::VectorXd column = to_vector(observation.history[i], start_position);
    if (i == 0) matrix.resize(column.size(), static_cast<Eigen::Index>(observation.history.size()));
    matrix.col(static_cast<Eigen::Index>(i)) = column;
  }
  return matrix;
}

}  // namespace duet
