#include "duet/tasks/rules/frame_windows.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace duet {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <typename Predicate>
FrameMask mask_of(const Eigen::ArrayXd& values, Predicate holds) {
  FrameMask mask(values.size());
  for (Eigen::Index t = 0; t < values.size(); ++t) mask[t] = holds(values[t]);
  return mask;
}

template <typename Operation>
FrameMask combine(const FrameMask& a, const FrameMask& b, Operation operation) {
  FrameMask mask(a.size());
  for (size_t t = 0; t < a.size(); ++t) mask[t] = operation(a[t], b[t]);
  return mask;
}

// Smallest maximum over windows of k allowed frames, infinity where there is none.
double smallest_window_max(const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  const int frames = static_cast<int>(values.size());
  double smallest = kInfinity;
  int run = 0;
  for (int t = 0; t < frames; ++t) {
    run = allowed[t] ? run + 1 : 0;
    if (run < k || values[t] >= smallest) continue;
    smallest = std::min(smallest, values.segment(t - k + 1, k).maxCoeff());
  }
  return smallest;
}

double kth_smallest(const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  std::vector<double> kept;
  for (Eigen::Index t = 0; t < values.size(); ++t)
    if (allowed[t]) kept.push_back(values[t]);
  if (static_cast<int>(kept.size()) < k) return kInfinity;
  std::nth_element(kept.begin(), kept.begin() + (k - 1), kept.end());
  return kept[k - 1];
}

template <typename Figure>
double slack(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed, Figure figure) {
  const double with_others = figure(values, k, allowed);
  return threshold - (with_others < kInfinity ? with_others : figure(values, k, FrameMask(values.size(), true)));
}

}  // namespace

int longest_run(const FrameMask& mask) {
  int longest = 0;
  int run = 0;
  for (const bool holds : mask) {
    run = holds ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest;
}

int count_frames(const FrameMask& mask) { return static_cast<int>(std::count(mask.begin(), mask.end(), true)); }

FrameMask both(const FrameMask& a, const FrameMask& b) {
  return combine(a, b, [](bool x, bool y) { return x && y; });
}
FrameMask either(const FrameMask& a, const FrameMask& b) {
  return combine(a, b, [](bool x, bool y) { return x || y; });
}

FrameMask below(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x < threshold; });
}
FrameMask at_most(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x <= threshold; });
}
FrameMask above(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x > threshold; });
}
FrameMask at_least(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x >= threshold; });
}

int frames_needed(double threshold) {
  constexpr double kMost = 1e9;  // more than any clip has; keeps the conversion defined
  return static_cast<int>(std::clamp(std::ceil(threshold), 1.0, kMost));
}

double run_slack_below(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return slack(threshold, values, k, allowed, smallest_window_max);
}
double run_slack_above(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return run_slack_below(-threshold, -values, k, allowed);
}
double count_slack_below(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return slack(threshold, values, k, allowed, kth_smallest);
}
double count_slack_above(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return count_slack_below(-threshold, -values, k, allowed);
}

}  // namespace duet
