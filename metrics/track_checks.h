// Checks of the metrics' inputs. All throw std::invalid_argument naming metric and argument. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <string>

#include "duet/core/point_tracks.h"

namespace duet {

// At least one frame and one point, every value finite. `what` is "jpe: robot".
void require_finite(const PointTracks& tracks, const std::string& what);
// The shape of `other`, which is called `other_name`.
void require_same_shape(const PointTracks& tracks, const PointTracks& other, const std::string& what,
                        const std::string& other_name);
// (joints, T), neither empty, every value finite.
void require_finite(const Eigen::MatrixXd& values, const std::string& what);
void require_same_shape(const Eigen::MatrixXd& values, const Eigen::MatrixXd& other, const std::string& what,
                        const std::string& other_name);

}  // namespace duet
