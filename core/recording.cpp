#include "duet/core/recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

namespace {

constexpr double kUnitTolerance = 1e-6;

void validate_sizes(const RobotMotion& motion, const std::string& what) {
  require(std::isfinite(motion.rate_hz) && motion.rate_hz > 0.0, "{}: expected a rate above 0 Hz, found {}", what,
          motion.rate_hz);
  require(motion.q.cols() == static_cast<Eigen::Index>(motion.root.size()),
          "{}: expected as many frames of joints as of the root ({}), found {}", what, motion.root.size(),
          motion.q.cols());
  require(motion.q.rows() == static_cast<Eigen::Index>(motion.joint_names.size()),
          "{}: expected {} joints as named, found {} rows of joint angles", what, motion.joint_names.size(),
          motion.q.rows());
}

// Messages are made only on failure: a motion has many numbers.
void validate_root(const Pose& X_WB, int frame, const std::string& what) {
  if (!X_WB.p.allFinite())
    throw std::invalid_argument(fmt::format("{}: root position of frame {} is not finite", what, frame));
  const double norm = X_WB.R.norm();
  if (!(std::abs(norm - 1.0) <= kUnitTolerance))  // also where the norm is not a number
    throw std::invalid_argument(
        fmt::format("{}: root quaternion of frame {}: expected norm 1, found {}", what, frame, norm));
}

}  // namespace

void validate(const RobotMotion& motion, const std::string& what) {
  validate_sizes(motion, what);
  for (int t = 0; t < motion.frames(); ++t) {
    validate_root(motion.root[static_cast<std::size_t>(t)], t, what);
    for (Eigen::Index j = 0; j < motion.q.rows(); ++j)
      if (!std::isfinite(motion.q(j, t)))
        throw std::invalid_argument(fmt::format("{}: angle of joint '{}' in frame {} is not finite", what,
                                                motion.joint_names[static_cast<std::size_t>(j)], t));
  }
}

RobotMotion resample(const RobotMotion& motion, double rate_hz) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "resample: expected a rate above 0 Hz, found {}", rate_hz);
  require(motion.frames() > 0, "resample: expected frames, found none");
  constexpr double kSameInstant = 1e-9;  // of a frame: two clocks that meet, meet
  const int last = motion.frames() - 1;
  const double step = motion.rate_hz / rate_hz;  // source frames per new frame
  RobotMotion result;
  result.rate_hz = rate_hz;
  result.joint_names = motion.joint_names;
  const int frames = static_cast<int>(std::floor(last / step * (1.0 + kSameInstant))) + 1;
  result.q.resize(motion.q.rows(), frames);
  for (int t = 0; t < frames; ++t) {
    const double instant = std::min(t * step, static_cast<double>(last));
    const int before = static_cast<int>(instant + kSameInstant);
    const int after = std::min(before + 1, last);
    const double share = std::max(0.0, instant - before);
    result.root.push_back(interpolate(motion.root[static_cast<std::size_t>(before)],
                                      motion.root[static_cast<std::size_t>(after)], share));
    result.q.col(t) = motion.q.col(before) + share * (motion.q.col(after) - motion.q.col(before));
  }
  return result;
}

}  // namespace duet
