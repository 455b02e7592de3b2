// Point tracks for the tests of metrics.
#pragma once

#include <Eigen/Geometry>
#include <functional>

#include "duet/core/numbers.h"
#include "duet/core/recording.h"

namespace duet::test {

inline PointTracks random_points(int frames, int points, std::uint64_t seed) {
  Random random(seed, 11);
  PointTracks tracks(frames, points);
  for (double& x : tracks.data()) x = random.uniform(-1.0, 1.0);
  return tracks;
}

inline PointTracks transformed(PointTracks tracks, const std::function<Eigen::Vector3d(Eigen::Vector3d)>& map) {
  for (int t = 0; t < tracks.frames(); ++t)
    for (int k = 0; k < tracks.points(); ++k) tracks.at(t, k) = map(tracks.at(t, k));
  return tracks;
}

// One moving point: (T, 1, 3).
inline PointTracks path(int frames, const std::function<Eigen::Vector3d(int)>& at) {
  PointTracks tracks(frames, 1);
  for (int t = 0; t < frames; ++t) tracks.at(t, 0) = at(t);
  return tracks;
}

}  // namespace duet::test
