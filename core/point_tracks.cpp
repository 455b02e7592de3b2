#include "duet/core/point_tracks.h"

#include "duet/core/require.h"

namespace duet {
namespace {

std::size_t checked_size(int frames, int points) {
  require(frames >= 0 && points >= 0, "point tracks: expected sizes >= 0, found {} frames of {} points", frames,
          points);
  return 3 * static_cast<std::size_t>(frames) * static_cast<std::size_t>(points);
}

}  // namespace

PointTracks::PointTracks(int frames, int points)
    : frames_(frames), points_(points), data_(checked_size(frames, points), 0.0) {}

PointTracks::PointTracks(int frames, int points, std::vector<double> data)
    : frames_(frames), points_(points), data_(std::move(data)) {
  const std::size_t expected = checked_size(frames, points);
  require(data_.size() == expected, "point tracks: expected {} numbers for ({}, {}, 3), found {}", expected, frames,
          points, data_.size());
}

PointTracks PointTracks::select(const std::vector<int>& points) const {
  for (const int k : points)
    require(k >= 0 && k < points_, "point tracks: expected a point in 0..{}, found {}", points_ - 1, k);
  PointTracks chosen(frames_, static_cast<int>(points.size()));
  for (int t = 0; t < frames_; ++t)
    for (std::size_t k = 0; k < points.size(); ++k) chosen.at(t, static_cast<int>(k)) = at(t, points[k]);
  return chosen;
}

PointTracks PointTracks::slice(int begin, int end) const {
  require(0 <= begin && begin <= end && end <= frames_, "point tracks: expected frames inside [0, {}), found [{}, {})",
          frames_, begin, end);
  const auto first = data_.begin() + static_cast<std::ptrdiff_t>(offset(begin, 0));
  const auto last = data_.begin() + static_cast<std::ptrdiff_t>(offset(end, 0));
  return {end - begin, points_, std::vector<double>(first, last)};
}

}  // namespace duet
