// Printed: contact frames are validated by the distance of the hand in contact to the performer's own root (line 10),
// although Table S11 speaks of the distance between the roots (reading `agent_roots`). The stability phase starts again
// from d < contact (line 18) and takes the whole sequence, although rolling values are computed.
#include <algorithm>
#include <cmath>
#include <limits>

#include "metrics/frame_windows.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

constexpr double kUndefined = std::numeric_limits<double>::infinity();
constexpr Eigen::Index kRollingWindow = 10;

Eigen::ArrayXd root_distances(const ClosestHands& closest, const Agent& performer, const Agent& partner,
                              const DetectorReadings& readings) {
  if (readings.handshake_distance == HandshakeDistance::kAgentRoots) return distances(performer.root, partner.root);
  const bool own = readings.handshake_active == HandshakeActive::kPerformerHand;
  const Agent& agent = own ? performer : partner;
  const std::vector<bool>& right = own ? closest.performer_right : closest.partner_right;
  const Eigen::ArrayXd left_distance = distances(agent.lhand, performer.root);
  const Eigen::ArrayXd right_distance = distances(agent.rhand, performer.root);
  Eigen::ArrayXd distance(left_distance.size());
  for (Eigen::Index t = 0; t < distance.size(); ++t) distance[t] = right[t] ? right_distance[t] : left_distance[t];
  return distance;
}

Eigen::ArrayXd at(const Eigen::ArrayXd& values, const FrameMask& mask) {
  Eigen::ArrayXd kept(count_frames(mask));
  for (Eigen::Index t = 0, i = 0; t < values.size(); ++t)
    if (mask[t]) kept[i++] = values[t];
  return kept;
}

struct Spread {
  double std = kUndefined, mean = kUndefined;  // infinite where undefined: no threshold is met then
};

Spread spread(const Eigen::ArrayXd& values, int ddof) {
  const double n = static_cast<double>(values.size());
  if (values.size() == 0) return {};
  const double mean = values.sum() / n;
  if (n <= ddof) return {kUndefined, mean};
  return {std::sqrt((values - mean).square().sum() / (n - ddof)), mean};
}

// One spread for the whole sequence, or one per window of ten (a shorter sequence is one window).
std::vector<Spread> spreads(const Eigen::ArrayXd& sequence, const DetectorReadings& readings) {
  const bool whole = readings.handshake_stability == HandshakeStability::kWhole;
  const Eigen::Index window = whole ? sequence.size() : std::min(kRollingWindow, sequence.size());
  std::vector<Spread> result;
  for (Eigen::Index t = 0; t + window <= sequence.size(); ++t)
    result.push_back(spread(sequence.segment(t, window), readings.handshake_ddof));
  return result;
}

// The spread that decides: of the windows the worst, or for `rolling_any` the one with the most room under both bounds.
Spread deciding(const std::vector<Spread>& windows, const Thresholds& tau, HandshakeStability reading) {
  const auto room = [&](const Spread& s) {
    return std::min(tau.at("std_contact") - s.std, tau.at("mean_contact") - s.mean);
  };
  Spread decides = windows.front();
  for (const Spread& s : windows) {
    if (reading == HandshakeStability::kRollingAny) {
      if (room(s) > room(decides)) decides = s;
    } else {
      decides = {std::max(decides.std, s.std), std::max(decides.mean, s.mean)};
    }
  }
  return decides;
}

}  // namespace

DetectorResult detect_handshake(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings& readings) {
  const ClosestHands closest = closest_hands(performer, partner);
  const Eigen::ArrayXd& d = closest.distance;
  const Eigen::ArrayXd d_root = root_distances(closest, performer, partner, readings);
  const FrameMask touching = below(d, tau.at("contact"));
  const FrameMask far_enough = at_least(d_root, tau.at("min_dist"));
  const FrameMask near_enough = at_most(d_root, tau.at("max_dist"));
  const FrameMask valid = both(touching, both(far_enough, near_enough));
  const double min_contact = tau.at("min_contact");
  const int run = longest_run(valid);
  const int count = count_frames(valid);

  const bool validated = readings.handshake_stability_frames == StabilityFrames::kValidated;
  const Eigen::ArrayXd sequence = at(d, validated ? valid : touching);
  const Spread spread =
      sequence.size() == 0 ? Spread{} : deciding(spreads(sequence, readings), tau, readings.handshake_stability);

  DetectorResult result;
  result.frames = valid;
  result.parts["contact_phase"] = count >= min_contact && run >= min_contact;
  result.parts["stability_phase"] = spread.std < tau.at("std_contact") && spread.mean < tau.at("mean_contact");
  result.success = result.parts["contact_phase"] && result.parts["stability_phase"];
  result.values = {
      {"distance_min", d.minCoeff()},           {"valid_contact_count", count},           {"max_consecutive", run},
      {"root_distance_min", d_root.minCoeff()}, {"root_distance_max", d_root.maxCoeff()}, {"stability_std", spread.std},
      {"stability_mean", spread.mean}};
  const int k = frames_needed(min_contact);
  result.margins = {{"contact", run_slack_below(tau.at("contact"), d, k, both(far_enough, near_enough))},
                    {"min_contact", run - min_contact},
                    {"min_dist", run_slack_above(tau.at("min_dist"), d_root, k, both(touching, near_enough))},
                    {"max_dist", run_slack_below(tau.at("max_dist"), d_root, k, both(touching, far_enough))},
                    {"std_contact", tau.at("std_contact") - spread.std},
                    {"mean_contact", tau.at("mean_contact") - spread.mean}};
  return result;
}

}  // namespace duet
