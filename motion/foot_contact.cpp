#include "duet/motion/foot_contact.h"

#include <algorithm>
#include <cmath>

#include "duet/core/skeleton.h"

namespace duet {
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
