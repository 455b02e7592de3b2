#include "duet/motion/human_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kUnitTolerance = 1e-6;
constexpr double kShortestBone = 1e-3;        // [m]
constexpr double kShortestHorizontal = 1e-3;  // of the sum of hip and shoulder lines [m]
// Instants closer than this fraction of a source period coincide: 2.4 * 5 is a frame of the source, not nearly one.
constexpr double kSameInstant = 1e-9;
constexpr double kMostFrames = 2e6;  // eleven hours at 50 Hz

std::string place(const std::string& what, int frame, int joint) {
  return fmt::format("{}: frame {}, joint '{}'", what, frame, kSmplNames[joint]);
}

void check_sizes(const HumanMotion& motion, const std::string& what) {
  require(std::isfinite(motion.rate_hz) && motion.rate_hz > 0.0, "{}: expected a positive rate, found {} Hz", what,
          motion.rate_hz);
  require(motion.joints.points() == kSmplJoints, "{}: expected {} joints, found {}", what, kSmplJoints,
          motion.joints.points());
  require(motion.frames() >= 2, "{}: expected at least 2 frames, found {}", what, motion.frames());
  const std::size_t expected = static_cast<std::size_t>(motion.frames()) * kSmplJoints;
  require(motion.rotations.empty() || motion.rotations.size() == expected,
          "{}: expected {} rotations (frames x joints) or none, found {}", what, expected, motion.rotations.size());
}

void check_positions(const HumanMotion& motion, const std::string& what) {
  for (int t = 0; t < motion.frames(); ++t) {
    const PointTracks::ConstFrame points = motion.joints.frame(t);
    for (int j = 0; j < kSmplJoints; ++j)
      if (!points.col(j).allFinite()) throw std::invalid_argument(place(what, t, j) + ": the position is not finite");
    for (int j = 1; j < kSmplJoints; ++j) {
      const double length = (points.col(j) - points.col(kSmplParents[j])).norm();
      if (length < kShortestBone)
        throw std::invalid_argument(fmt::format("{}: the bone to '{}' is {:.3g} m long, expected at least {} m",
                                                place(what, t, j), kSmplNames[kSmplParents[j]], length, kShortestBone));
    }
  }
}

void check_rotations(const HumanMotion& motion, const std::string& what) {
  for (std::size_t i = 0; i < motion.rotations.size(); ++i) {
    const double norm = motion.rotations[i].norm();
    if (std::abs(norm - 1.0) <= kUnitTolerance) continue;  // false for NaN
    throw std::invalid_argument(fmt::format("{}: expected a unit quaternion, found length {}",
                                            place(what, static_cast<int>(i / kSmplJoints), i % kSmplJoints), norm));
  }
}

}  // namespace

void validate(const HumanMotion& motion, const std::string& what) {
  check_sizes(motion, what);
  check_positions(motion, what);
  check_rotations(motion, what);
}

std::array<double, kSmplJoints> bone_lengths(const HumanMotion& motion) {
  require(motion.joints.points() == kSmplJoints && motion.frames() > 0,
          "bone lengths: expected {} joints and at least one frame, found {} and {}", kSmplJoints,
          motion.joints.points(), motion.frames());
  std::array<double, kSmplJoints> lengths{};
  for (int t = 0; t < motion.frames(); ++t)
    for (int j = 1; j < kSmplJoints; ++j)
      lengths[j] += (motion.joints.at(t, j) - motion.joints.at(t, kSmplParents[j])).norm();
  for (double& length : lengths) length /= motion.frames();
  return lengths;
}

double heading(const PointTracks& joints, int frame) {
  const Eigen::Vector3d left = joints.at(frame, kLeftHip) - joints.at(frame, kRightHip) +
                               joints.at(frame, kLeftShoulder) - joints.at(frame, kRightShoulder);
  if (!(left.head<2>().norm() >= kShortestHorizontal))
    throw std::invalid_argument(fmt::format(
        "heading at frame {}: the lines of hips and shoulders have no horizontal part (sum ({:.3g}, {:.3g}) m)", frame,
        left.x(), left.y()));
  return std::atan2(-left.x(), left.y());
}

HumanMotion resample(const HumanMotion& motion, double rate_hz) {
  require(std::isfinite(rate_hz) && rate_hz > 0.0, "resample: expected a positive rate, found {}", rate_hz);
  require(std::isfinite(motion.rate_hz) && motion.rate_hz > 0.0,
          "resample: expected a source with a positive rate, found {}", motion.rate_hz);
  require(motion.frames() > 0, "resample: the motion has no frames");
  const int points = motion.joints.points();
  const int frames = resampled_frames(motion.frames(), motion.rate_hz, rate_hz);

  HumanMotion result{.rate_hz = rate_hz, .joints = PointTracks(frames, points), .rotations = {}};
  result.rotations.reserve(motion.rotations.empty() ? 0 : static_cast<std::size_t>(frames) * points);
  for (int t = 0; t < frames; ++t) {
    const FrameBetween at = frame_between(t * (motion.rate_hz / rate_hz), motion.frames());
    const int next = at.part > 0.0 ? at.frame + 1 : at.frame;
    const PointTracks::ConstFrame before = motion.joints.frame(at.frame);
    result.joints.frame(t) = before;
    if (at.part > 0.0) result.joints.frame(t) += at.part * (motion.joints.frame(next) - before);
    for (int j = 0; j < (motion.rotations.empty() ? 0 : points); ++j) {
      const Eigen::Quaterniond& R = motion.rotations[static_cast<std::size_t>(at.frame) * points + j];
      const Eigen::Quaterniond& R_next = motion.rotations[static_cast<std::size_t>(next) * points + j];
      result.rotations.push_back(at.part > 0.0 ? R.slerp(at.part, R_next).normalized() : R);
    }
  }
  return result;
}

FrameBetween frame_between(double index, int frames) {
  const double nearest = std::round(index);
  if (std::abs(index - nearest) <= kSameInstant * std::max(1.0, nearest)) return {static_cast<int>(nearest), 0.0};
  const int frame = std::min(static_cast<int>(index), frames - 2);
  return {frame, index - frame};
}

int resampled_frames(int frames, double rate_hz, double new_rate_hz) {
  const double last = (frames - 1) * (new_rate_hz / rate_hz);
  require(last < kMostFrames, "resample: {} frames at {} Hz are more than {:g} frames at {} Hz", frames, rate_hz,
          kMostFrames, new_rate_hz);
  return static_cast<int>(std::floor(last * (1.0 + kSameInstant))) + 1;
}

HumanMotion slice(const HumanMotion& motion, int begin, int end) {
  HumanMotion result{.rate_hz = motion.rate_hz, .joints = motion.joints.slice(begin, end), .rotations = {}};
  if (!motion.rotations.empty()) {
    const int points = motion.joints.points();
    result.rotations.assign(motion.rotations.begin() + static_cast<std::ptrdiff_t>(begin) * points,
                            motion.rotations.begin() + static_cast<std::ptrdiff_t>(end) * points);
  }
  return result;
}

namespace {

struct Span {
  int begin = 0, end = 0;
};

std::vector<Span> spans_of(const std::vector<char>& flags) {
  std::vector<Span> spans;
  const int size = static_cast<int>(flags.size());
  for (int t = 0; t < size; ++t) {
    if (flags[t] == 0) continue;
    if (t == 0 || flags[t - 1] == 0) spans.push_back({t, t});
    spans.back().end = t + 1;
  }
  return spans;
}

double percentile_tenth(Eigen::VectorXd values) {
  const auto nth = values.size() / 10;
  std::nth_element(values.data(), values.data() + nth, values.data() + values.size());
  return values[nth];
}

// Frames of windows in which the path stays in one place.
std::vector<char> still_frames(const Eigen::MatrixXd& path, int window, double place) {
  const Eigen::Index frames = path.cols();
  std::vector<char> still(frames, 0);
  for (Eigen::Index begin = 0; begin == 0 || begin + window <= frames; ++begin) {
    const Eigen::Index length = std::min<Eigen::Index>(window, frames - begin);
    const auto part = path.block(0, begin, 2, length);
    const Eigen::Vector2d middle = part.rowwise().mean();
    if ((part.colwise() - middle).colwise().norm().maxCoeff() <= place)
      std::fill(still.begin() + begin, still.begin() + begin + length, 1);
  }
  return still;
}

// A stance whose place moves on becomes two, with a step between.
void split_drift(const Eigen::MatrixXd& path, double drift, int step, std::vector<char>& stands) {
  for (const Span& span : spans_of(stands)) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    int begin = span.begin;
    for (int t = span.begin; t < span.end; ++t) {
      sum += path.col(t).head<2>();
      if ((path.col(t).head<2>() - sum / (t - begin + 1)).norm() <= drift) continue;
      for (int k = std::max(t - step, begin); k < t; ++k) stands[k] = 0;
      begin = t;
      sum = path.col(t).head<2>();
    }
  }
}

// A step takes time: a shorter gap between two stances takes it from both.
void widen_steps(int step, std::vector<char>& stands) {
  const std::vector<Span> spans = spans_of(stands);
  for (std::size_t i = 1; i < spans.size(); ++i) {
    const int missing = step - (spans[i].begin - spans[i - 1].end);
    for (int k = 0; k < (missing + 1) / 2; ++k) {
      stands[std::max(spans[i - 1].end - 1 - k, spans[i - 1].begin)] = 0;
      stands[std::min(spans[i].begin + k, spans[i].end - 1)] = 0;
    }
  }
}

std::vector<char> stance_of_foot(const HumanMotion& motion, int ankle, int toe, const StanceRule& rule) {
  const int frames = motion.frames();
  Eigen::MatrixXd path(3, frames);
  for (int t = 0; t < frames; ++t) {
    path.col(t) = motion.joints.at(t, ankle);
    path(2, t) = std::min(path(2, t), motion.joints.at(t, toe).z() + 0.05);
  }
  path = smoothed(path, rule.smoothing * motion.rate_hz);
  const auto samples = [&](double seconds) {
    return std::max(1, static_cast<int>(std::lround(seconds * motion.rate_hz)));
  };
  std::vector<char> stands = still_frames(path, samples(rule.window), rule.place);
  split_drift(path, rule.drift, samples(rule.step), stands);
  const double highest = percentile_tenth(path.row(2).transpose()) + rule.height;
  for (int t = 0; t < frames; ++t) {
    if (path(2, t) > highest) stands[t] = 0;
  }
  widen_steps(samples(rule.step), stands);
  return stands;
}

}  // namespace

Eigen::MatrixXd smoothed(const Eigen::MatrixXd& x, double sigma) {
  if (sigma <= 0.0) return x;
  const int radius = static_cast<int>(std::ceil(3.0 * sigma));
  Eigen::VectorXd weight(2 * radius + 1);
  for (int k = -radius; k <= radius; ++k) weight[k + radius] = std::exp(-0.5 * k * k / (sigma * sigma));
  weight /= weight.sum();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index t = 0; t < x.cols(); ++t) {
    for (int k = -radius; k <= radius; ++k)
      out.col(t) += weight[k + radius] * x.col(std::clamp<Eigen::Index>(t + k, 0, x.cols() - 1));
  }
  return out;
}

FootStance find_stance(const HumanMotion& motion, const StanceRule& rule) {
  return {{stance_of_foot(motion, kLeftAnkle, kLeftToe, rule), stance_of_foot(motion, kRightAnkle, kRightToe, rule)}};
}

}  // namespace duet
