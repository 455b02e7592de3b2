// The task's signal says how far the act is under way (larger = more); the act is the stretch around its peak above a
// threshold. docs/conventions.md describes signals and thresholds.
#include "duet/motion/phase_proposal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "duet/core/require.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

using Signal = std::vector<double>;

constexpr double kReach = 0.20;          // hands this much farther apart than at their nearest are still in the act [m]
constexpr double kRaisedShare = 0.35;    // of the way from rest to peak: the hand is on its way up
constexpr double kLoweredShare = 0.75;   // ... and on its way down again
constexpr double kCoveredShare = 0.50;   // of the gap between the people that reaching hands cover at most
constexpr double kLeanShare = 0.15;      // of the deepest bow
constexpr double kLeastHandRise = 0.10;  // a smaller rise of the hands is no gesture [m]
constexpr double kLeastLean = 0.10;      // a smaller bow is no gesture [rad]
constexpr double kClaspGap = 1.5;        // shorter interruptions of a contact belong to the act (a second clap) [s]
constexpr double kGestureGap = 5.0;      // ... of a gesture (the other's reply) [s]
constexpr double kOnsetGap = 0.1;        // ... of the reach for a contact [s]
constexpr double kRestQuantile = 0.10;

Eigen::Vector3d chest(const HumanMotion& motion, int t) {
  return 0.5 * (motion.joints.at(t, kSpine3) + motion.joints.at(t, kNeck));
}

// Distance of the nearest hands of the two people. [m]
double hand_distance(const HumanMotion& a, const HumanMotion& b, int t) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const int hand_a : {kLeftHand, kRightHand})
    for (const int hand_b : {kLeftHand, kRightHand})
      nearest = std::min(nearest, (a.joints.at(t, hand_a) - b.joints.at(t, hand_b)).norm());
  return nearest;
}

// Distance of the nearer hand of `who` from the other's chest. [m]
double hand_to_chest(const HumanMotion& who, const HumanMotion& other, int t) {
  const Eigen::Vector3d target = chest(other, t);
  return std::min((who.joints.at(t, kLeftHand) - target).norm(), (who.joints.at(t, kRightHand) - target).norm());
}

// How much of the way between the two pelvises the nearest hands cover. [m]
double covered_gap(const HumanMotion& a, const HumanMotion& b, int t) {
  return (a.joints.at(t, kPelvis) - b.joints.at(t, kPelvis)).norm() - hand_distance(a, b, t);
}

// Height of the higher hand above the pelvis. [m]
double hand_rise(const HumanMotion& who, int t) {
  return std::max(who.joints.at(t, kLeftHand).z(), who.joints.at(t, kRightHand).z()) - who.joints.at(t, kPelvis).z();
}

// Angle of the trunk from vertical. [rad]
double lean(const HumanMotion& who, int t) {
  const Eigen::Vector3d trunk = who.joints.at(t, kNeck) - who.joints.at(t, kPelvis);
  return std::atan2(trunk.head<2>().norm(), trunk.z());
}

template <typename F>
Signal over_time(int frames, F&& value) {
  Signal signal(frames);
  for (int t = 0; t < frames; ++t) signal[t] = value(t);
  return signal;
}

double rest_level(Signal signal) {
  const auto rest = signal.begin() + static_cast<std::ptrdiff_t>(kRestQuantile * (signal.size() - 1));
  std::nth_element(signal.begin(), rest, signal.end());
  return *rest;
}

// The act is where `signal` is above the thresholds around its peak; it begins earlier where `onset` says so.
struct Activity {
  Signal signal;
  double begin_threshold = 0.0;
  double end_threshold = 0.0;
  double gap = 0.0;  // [s]
  Signal onset;
  double onset_threshold = 0.0;
  bool found = false;  // the signal moves enough to call its peak an act
};

// From 0 at rest to 1 at the peak; all 0 where the range is smaller than `least`.
Signal share(const Signal& signal, double least) {
  const double rest = rest_level(signal);
  const double range = *std::max_element(signal.begin(), signal.end()) - rest;
  Signal result(signal.size(), 0.0);
  if (range >= least)
    std::transform(signal.begin(), signal.end(), result.begin(), [&](double x) { return (x - rest) / range; });
  return result;
}

// The larger signal of the two people, each measured by the own peak.
Signal either(const Signal& a, const Signal& b, double least) {
  Signal result = share(a, least);
  const Signal other = share(b, least);
  std::transform(result.begin(), result.end(), other.begin(), result.begin(),
                 [](double x, double y) { return std::max(x, y); });
  return result;
}

Signal hands_up(const HumanMotion& a, const HumanMotion& b) {
  return either(over_time(a.frames(), [&](int t) { return hand_rise(a, t); }),
                over_time(b.frames(), [&](int t) { return hand_rise(b, t); }), kLeastHandRise);
}

Activity contact(Signal distance, Signal onset, double onset_threshold) {
  for (double& value : distance) value = -value;
  const double edge = *std::max_element(distance.begin(), distance.end()) - kReach;
  return {.signal = std::move(distance),
          .begin_threshold = edge,
          .end_threshold = edge,
          .gap = kClaspGap,
          .onset = std::move(onset),
          .onset_threshold = onset_threshold,
          .found = true};
}

Activity gesture(Signal signal, double begin_share, double end_share) {
  const bool found = *std::max_element(signal.begin(), signal.end()) > 0.0;
  return {.signal = std::move(signal),
          .begin_threshold = begin_share,
          .end_threshold = end_share,
          .gap = kGestureGap,
          .onset = {},
          .onset_threshold = 0.0,
          .found = found};
}

// The onset of a contact, where the task reaches for it: its signal and threshold.
std::pair<Signal, double> onset_of(const HumanMotion& a, const HumanMotion& b, OnsetSignal onset) {
  switch (onset) {
    case OnsetSignal::kHandsCoverTheGap:
      return {share(over_time(a.frames(), [&](int t) { return covered_gap(a, b, t); }), kReach), kCoveredShare};
    case OnsetSignal::kHandsUp:
      return {hands_up(a, b), kRaisedShare};
    case OnsetSignal::kNone:
      break;
  }
  return {{}, 0.0};
}

Activity activity_of(const HumanMotion& a, const HumanMotion& b, const PhaseSignal& signal) {
  const auto over = [&](auto&& value) { return over_time(a.frames(), value); };
  auto [onset, threshold] = onset_of(a, b, signal.onset);
  switch (signal.act) {
    case ActSignal::kHandsTogether:
      return contact(over([&](int t) { return hand_distance(a, b, t); }), std::move(onset), threshold);
    case ActSignal::kHandAtChest:
      return contact(over([&](int t) { return std::min(hand_to_chest(a, b, t), hand_to_chest(b, a, t)); }),
                     std::move(onset), threshold);
    case ActSignal::kHandsUp:
      return gesture(hands_up(a, b), kRaisedShare, kLoweredShare);
    case ActSignal::kTrunksLean:
      return gesture(
          either(over([&](int t) { return lean(a, t); }), over([&](int t) { return lean(b, t); }), kLeastLean),
          kLeanShare, kLeanShare);
  }
  return {};
}

// The last frame from `from` in direction `step` (-1 or 1) at or above the threshold, without a gap of more than `gap`
// frames.
int reach(const Signal& signal, int from, int step, double threshold, int gap) {
  int edge = from;
  for (int t = from; t >= 0 && t < static_cast<int>(signal.size()) && std::abs(t - edge) <= gap + 1; t += step)
    if (signal[t] >= threshold) edge = t;
  return edge;
}

Phases stretch(const Activity& activity, double rate_hz) {
  const auto frames = [&](double seconds) { return static_cast<int>(seconds * rate_hz); };
  const Signal& signal = activity.signal;
  const int peak = static_cast<int>(std::max_element(signal.begin(), signal.end()) - signal.begin());
  const int begin = reach(signal, peak, -1, activity.begin_threshold, frames(activity.gap));
  const int end = reach(signal, peak, 1, activity.end_threshold, frames(activity.gap));
  return {.act_begin = reach(activity.onset, begin, -1, activity.onset_threshold, frames(kOnsetGap)),
          .act_end = end + 1};
}

}  // namespace

Phases propose_phases(const HumanMotion& a, const HumanMotion& b, Task task) {
  require(a.joints.points() == kSmplJoints && b.joints.points() == kSmplJoints,
          "phase proposal: expected {} joints, found {} and {}", kSmplJoints, a.joints.points(), b.joints.points());
  require(a.frames() == b.frames() && a.frames() >= 1,
          "phase proposal: expected two motions of the same length, found {} and {} frames", a.frames(), b.frames());
  const Activity activity = activity_of(a, b, definition_of(task).phases);
  if (!activity.found) return {.act_begin = a.frames() / 3, .act_end = std::max(a.frames() - a.frames() / 3, 1)};
  return stretch(activity, a.rate_hz);
}

}  // namespace duet
