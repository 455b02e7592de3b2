// ValHandHeight is not printed: by default both hands of the closest pair must be high enough over the performer's
// root.
#include <algorithm>

#include "metrics/frame_windows.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

// Per frame the height that must reach the threshold. [m]
Eigen::ArrayXd judged_heights(const ClosestHands& closest, const Agent& performer, const Agent& partner,
                              HighFiveHeight reading) {
  const Eigen::ArrayXd own_left = heights(performer.lhand, performer.root);
  const Eigen::ArrayXd own_right = heights(performer.rhand, performer.root);
  const Eigen::ArrayXd other_left = heights(partner.lhand, performer.root);
  const Eigen::ArrayXd other_right = heights(partner.rhand, performer.root);
  if (reading == HighFiveHeight::kPerformerAny) return own_left.max(own_right);
  if (reading == HighFiveHeight::kAnyHand) return own_left.max(own_right).max(other_left.max(other_right));

  Eigen::ArrayXd judged(own_left.size());
  for (Eigen::Index t = 0; t < judged.size(); ++t) {
    const double own = closest.performer_right[t] ? own_right[t] : own_left[t];
    const double other = closest.partner_right[t] ? other_right[t] : other_left[t];
    judged[t] = reading == HighFiveHeight::kPerformerClosest ? own
                : reading == HighFiveHeight::kPartnerClosest ? other
                                                             : std::min(own, other);
  }
  return judged;
}

}  // namespace

DetectorResult detect_high_five(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings& readings) {
  const bool heights_count = readings.high_five_height != HighFiveHeight::kOff;
  const ClosestHands closest = closest_hands(performer, partner);
  const Eigen::ArrayXd& d = closest.distance;
  const Eigen::ArrayXd height = judged_heights(closest, performer, partner, readings.high_five_height);
  const FrameMask close = below(d, tau.at("contact"));
  const FrameMask high = heights_count ? at_least(height, tau.at("height")) : FrameMask(d.size(), true);

  DetectorResult result;
  result.frames = both(close, high);
  const int count = count_frames(result.frames);
  const int run = longest_run(result.frames);
  result.parts["approach"] = count >= tau.at("min_approach");
  result.parts["not_sustained"] = run <= tau.at("max_sustained");
  result.success = result.parts["approach"] && result.parts["not_sustained"];
  result.values = {{"distance_min", d.minCoeff()}, {"contact_count", count}, {"consecutive_count", run}};

  const int k = frames_needed(tau.at("min_approach"));
  result.margins = {{"contact", count_slack_below(tau.at("contact"), d, k, high)},
                    {"min_approach", count - tau.at("min_approach")},
                    {"max_sustained", tau.at("max_sustained") - run}};
  if (heights_count) {
    result.margins["height"] = count_slack_above(tau.at("height"), height, k, close);
    result.values["height_max"] = height.maxCoeff();
  }
  return result;
}

}  // namespace duet
