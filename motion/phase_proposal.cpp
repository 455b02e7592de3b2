// One signal per task says how far the act is under way (larger = more); the act is the stretch around its peak above a
// threshold. docs/conventions.md describes signals and thresholds.
#include "motion/phase_proposal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/require.h"

namespace duet {
namespace {

using Signal = std::vector<double>;

constexpr double kReach = 0.20;          // hands this much farther apart than at their nearest are still in the act [m]
constexpr double kGestureShare = 0.35;   // of the way from rest to peak
constexpr double kLeastHandRise = 0.10;  // a smaller rise of the hands is no gesture [m]
constexpr double kLeastLean = 0.10;      // a smaller bow is no gesture [rad]
constexpr double kGap = 0.40;            // shorter interruptions belong to the act [s]
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

struct Activity {
  Signal signal;
  double threshold = 0.0;
  bool found = false;  // the signal moves enough to call its peak an act
};

Activity near_contact(Signal distance) {
  for (double& value : distance) value = -value;
  const double peak = *std::max_element(distance.begin(), distance.end());
  return {.signal = std::move(distance), .threshold = peak - kReach, .found = true};
}

// A gesture of either person: the one who moves more, and both where both do it.
Activity gesture(const Signal& a, const Signal& b, double least) {
  const auto share = [&](const Signal& signal) {
    const double rest = rest_level(signal);
    const double range = *std::max_element(signal.begin(), signal.end()) - rest;
    Signal result(signal.size(), 0.0);
    if (range >= least)
      std::transform(signal.begin(), signal.end(), result.begin(), [&](double x) { return (x - rest) / range; });
    return result;
  };
  const Signal of_a = share(a);
  const Signal of_b = share(b);
  Activity activity{.signal = Signal(a.size()), .threshold = kGestureShare, .found = false};
  for (std::size_t t = 0; t < a.size(); ++t) activity.signal[t] = std::max(of_a[t], of_b[t]);
  activity.found = *std::max_element(activity.signal.begin(), activity.signal.end()) >= 1.0;
  return activity;
}

Activity activity_of(const HumanMotion& a, const HumanMotion& b, Task task) {
  const int frames = a.frames();
  switch (task) {
    case Task::kHandshake:
    case Task::kHighFive:
      return near_contact(over_time(frames, [&](int t) { return hand_distance(a, b, t); }));
    case Task::kHug:
      return near_contact(
          over_time(frames, [&](int t) { return std::min(hand_to_chest(a, b, t), hand_to_chest(b, a, t)); }));
    case Task::kWave:
    case Task::kFlyKiss:
      return gesture(over_time(frames, [&](int t) { return hand_rise(a, t); }),
                     over_time(frames, [&](int t) { return hand_rise(b, t); }), kLeastHandRise);
    case Task::kBend:
      return gesture(over_time(frames, [&](int t) { return lean(a, t); }),
                     over_time(frames, [&](int t) { return lean(b, t); }), kLeastLean);
  }
  return {};
}

// The stretch above the threshold around the peak, interruptions up to `gap` frames included.
Phases stretch(const Activity& activity, int gap) {
  const int frames = static_cast<int>(activity.signal.size());
  const auto grow = [&](int from, int step) {
    int edge = from;
    for (int t = from; t >= 0 && t < frames && std::abs(t - edge) <= gap + 1; t += step)
      if (activity.signal[t] >= activity.threshold) edge = t;
    return edge;
  };
  const int peak =
      static_cast<int>(std::max_element(activity.signal.begin(), activity.signal.end()) - activity.signal.begin());
  return {.act_begin = grow(peak, -1), .act_end = grow(peak, 1) + 1};
}

}  // namespace

Phases propose_phases(const HumanMotion& a, const HumanMotion& b, Task task) {
  require(a.joints.points() == kSmplJoints && b.joints.points() == kSmplJoints,
          fmt::format("phase proposal: expected {} joints, found {} and {}", kSmplJoints, a.joints.points(),
                      b.joints.points()));
  require(a.frames() == b.frames() && a.frames() >= 1,
          fmt::format("phase proposal: expected two motions of the same length, found {} and {} frames", a.frames(),
                      b.frames()));
  const Activity activity = activity_of(a, b, task);
  if (!activity.found) return {.act_begin = a.frames() / 3, .act_end = std::max(a.frames() - a.frames() / 3, 1)};
  return stretch(activity, static_cast<int>(kGap * a.rate_hz));
}

}  // namespace duet
