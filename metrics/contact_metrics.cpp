// Multi-threshold contact classification: which hands touch, in the source and after retargeting. An entry is a frame
// and a hand of the initiator; its partner hand comes from the matching.

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "duet/core/require.h"
#include "duet/metrics/retargeting.h"
#include "duet/metrics/track_checks.h"
#include "duet/tasks/rules/frame_windows.h"

namespace duet {
namespace {

// Distances of the initiator's hand (row) and the other's (column), left then right. [m]
using HandDistances = Eigen::Matrix2d;

std::vector<HandDistances> hand_distances(const PointTracks& initiator, const PointTracks& other) {
  std::vector<HandDistances> distances(initiator.frames());
  for (int t = 0; t < initiator.frames(); ++t)
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) distances[t](i, j) = (initiator.at(t, i) - other.at(t, j)).norm();
  return distances;
}

// Whether left goes with right. A tie pairs left with left.
bool crossed_by_sum(const HandDistances& d) { return d(0, 1) + d(1, 0) < d(0, 0) + d(1, 1); }
bool crossed_by_max(const HandDistances& d) { return std::max(d(0, 1), d(1, 0)) < std::max(d(0, 0), d(1, 1)); }

FrameMask crossed_frames(const std::vector<HandDistances>& distances, HandMatching matching) {
  FrameMask crossed(distances.size());
  if (matching == HandMatching::kIndependentSequence || matching == HandMatching::kSourceSequence) {
    HandDistances sum = HandDistances::Zero();
    for (const HandDistances& d : distances) sum += d;
    crossed.assign(distances.size(), crossed_by_sum(sum));
    return crossed;
  }
  const bool bottleneck = matching == HandMatching::kIndependentBottleneck;
  for (size_t t = 0; t < distances.size(); ++t)
    crossed[t] = bottleneck ? crossed_by_max(distances[t]) : crossed_by_sum(distances[t]);
  return crossed;
}

void drop_short_runs(FrameMask& contact, int min_frames) {
  size_t begin = 0;
  while (begin < contact.size()) {
    size_t end = begin;
    while (end < contact.size() && contact[end]) ++end;
    if (end - begin < static_cast<size_t>(min_frames))
      std::fill(contact.begin() + static_cast<long>(begin), contact.begin() + static_cast<long>(end), false);
    begin = end + 1;
  }
}

// Contact of the initiator's left and right hand per frame.
std::array<FrameMask, 2> contacts(const std::vector<HandDistances>& distances, const FrameMask& crossed,
                                  double threshold, const MetricReadings& readings) {
  std::array<FrameMask, 2> result;
  for (int hand = 0; hand < 2; ++hand) {
    FrameMask& contact = result[hand];
    contact.resize(distances.size());
    for (size_t t = 0; t < distances.size(); ++t) {
      const double d = distances[t](hand, crossed[t] ? 1 - hand : hand);
      contact[t] = readings.contact_compare == Compare::kLt ? d < threshold : d <= threshold;
    }
    drop_short_runs(contact, readings.min_frames);
  }
  return result;
}

void check(const PointTracks& hands, const PointTracks& first, const char* name) {
  const std::string what = std::string("contact_counts: ") + name;
  require_finite(hands, what);
  require(hands.points() == 2, "{} has {} points, expected 2 hands", what, hands.points());
  require_same_shape(hands, first, what, "source_initiator");
}

double ratio(double part, double whole, ZeroDivision zero_division) {
  if (whole > 0.0) return part / whole;
  switch (zero_division) {
    case ZeroDivision::kZero:
      return 0.0;
    case ZeroDivision::kOne:
      return 1.0;
    case ZeroDivision::kNan:
      break;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

ContactCounts& ContactCounts::operator+=(const ContactCounts& other) {
  tp += other.tp;
  fp += other.fp;
  fn += other.fn;
  tn += other.tn;
  return *this;
}

ContactCounts contact_counts(const PointTracks& source_initiator, const PointTracks& source_responder,
                             const PointTracks& new_initiator, const PointTracks& robot, double threshold,
                             const MetricReadings& readings) {
  check(source_initiator, source_initiator, "source_initiator");
  check(source_responder, source_initiator, "source_responder");
  check(new_initiator, source_initiator, "new_initiator");
  check(robot, source_initiator, "robot");
  require(std::isfinite(threshold) && threshold > 0.0, "contact_counts: the threshold must be positive, found {}",
          threshold);
  require(readings.min_frames >= 1, "contact_counts: min_frames must be 1 or more, found {}", readings.min_frames);

  const std::vector<HandDistances> source = hand_distances(source_initiator, source_responder);
  const std::vector<HandDistances> after = hand_distances(new_initiator, robot);
  const FrameMask source_crossed = crossed_frames(source, readings.matching);
  const bool own =
      readings.matching != HandMatching::kSourceFrame && readings.matching != HandMatching::kSourceSequence;
  const std::array<FrameMask, 2> truth = contacts(source, source_crossed, threshold, readings);
  const std::array<FrameMask, 2> found =
      contacts(after, own ? crossed_frames(after, readings.matching) : source_crossed, threshold, readings);

  ContactCounts counts;
  for (int hand = 0; hand < 2; ++hand)
    for (size_t t = 0; t < source.size(); ++t)
      ++(truth[hand][t] ? (found[hand][t] ? counts.tp : counts.fn) : (found[hand][t] ? counts.fp : counts.tn));
  return counts;
}

// F1 from the counts, so that it is 0 rather than undefined where only one of precision and recall is undefined.
Classification classification(const ContactCounts& counts, ZeroDivision zero_division) {
  const auto tp = static_cast<double>(counts.tp);
  const auto fp = static_cast<double>(counts.fp);
  const auto fn = static_cast<double>(counts.fn);
  const auto tn = static_cast<double>(counts.tn);
  return {.precision = ratio(tp, tp + fp, zero_division),
          .recall = ratio(tp, tp + fn, zero_division),
          .f1 = ratio(2.0 * tp, 2.0 * tp + fp + fn, zero_division),
          .accuracy = ratio(tp + tn, tp + fp + fn + tn, zero_division)};
}

}  // namespace duet
