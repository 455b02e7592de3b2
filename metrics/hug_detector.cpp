// Only the double embrace is printed. The single embrace takes one hand within `body` of the torso, the shoulder
// embrace both hands within `shoulder` of the nearer shoulder; the readings offer the alternatives.
#include <algorithm>
#include <limits>

#include "metrics/frame_windows.h"
#include "metrics/task_detectors.h"

namespace duet {
namespace {

// A way to embrace: frames at which it holds and by how much, per track of evidence. Several only where each hand
// counts for itself.
struct Mode {
  std::vector<FrameMask> holds;
  std::vector<Eigen::ArrayXd> slack;
};

struct HandDistances {
  Eigen::ArrayXd hands, left_torso, right_torso;
  Eigen::ArrayXd left_shoulder, right_shoulder;  // of each hand to the nearer shoulder; empty where not needed
};

HandDistances hand_distances(const Agent& performer, const Agent& partner, HugShoulder shoulder) {
  HandDistances d;
  d.hands = distances(performer.lhand, performer.rhand);
  d.left_torso = distances(performer.lhand, partner.torso);
  d.right_torso = distances(performer.rhand, partner.torso);
  if (shoulder == HugShoulder::kBothHands || shoulder == HugShoulder::kAnyHand) {
    d.left_shoulder = distances(performer.lhand, partner.lshoulder).min(distances(performer.lhand, partner.rshoulder));
    d.right_shoulder = distances(performer.rhand, partner.lshoulder).min(distances(performer.rhand, partner.rshoulder));
  }
  return d;
}

Mode closer_than(double threshold, const Eigen::ArrayXd& distance) {
  return {{below(distance, threshold)}, {threshold - distance}};
}

Mode double_mode(const HandDistances& d, double hand_dist, double body) {
  const Eigen::ArrayXd farther = d.left_torso.max(d.right_torso);
  return {{both(below(d.hands, hand_dist), below(farther, body))}, {(hand_dist - d.hands).min(body - farther)}};
}

Mode single_mode(const HandDistances& d, double body, HugSingle reading) {
  const Eigen::ArrayXd nearer = d.left_torso.min(d.right_torso);
  const Eigen::ArrayXd farther = d.left_torso.max(d.right_torso);
  switch (reading) {
    case HugSingle::kAnyHand:
      return closer_than(body, nearer);
    case HugSingle::kSameHand:
      return {{below(d.left_torso, body), below(d.right_torso, body)}, {body - d.left_torso, body - d.right_torso}};
    case HugSingle::kExactlyOne:
      return {{both(below(nearer, body), at_least(farther, body))}, {(body - nearer).min(farther - body)}};
    case HugSingle::kOff:
      break;
  }
  return {};
}

Mode shoulder_mode(const HandDistances& d, double shoulder, HugShoulder reading) {
  switch (reading) {
    case HugShoulder::kBothHands:
      return closer_than(shoulder, d.left_shoulder.max(d.right_shoulder));
    case HugShoulder::kAnyHand:
      return closer_than(shoulder, d.left_shoulder.min(d.right_shoulder));
    case HugShoulder::kTorsoBoth:
      return closer_than(shoulder, d.left_torso.max(d.right_torso));
    case HugShoulder::kTorsoAny:
      return closer_than(shoulder, d.left_torso.min(d.right_torso));
    case HugShoulder::kOff:
      break;
  }
  return {};
}

int run_of(const Mode& mode) {
  int longest = 0;
  for (const FrameMask& holds : mode.holds) longest = std::max(longest, longest_run(holds));
  return longest;
}

double margin_of(const Mode& mode, int k) {
  double best = -std::numeric_limits<double>::infinity();
  for (const Eigen::ArrayXd& slack : mode.slack)
    best = std::max(best, run_slack_above(0.0, slack, k, FrameMask(slack.size(), true)));
  return best;
}

void add_values(const HandDistances& d, DetectorResult& result) {
  result.values["hands_distance_min"] = d.hands.minCoeff();
  result.values["torso_distance_min"] = d.left_torso.min(d.right_torso).minCoeff();
  result.values["torso_distance_both_min"] = d.left_torso.max(d.right_torso).minCoeff();
  if (d.left_shoulder.size() == 0) return;
  result.values["shoulder_distance_min"] = d.left_shoulder.min(d.right_shoulder).minCoeff();
  result.values["shoulder_distance_both_min"] = d.left_shoulder.max(d.right_shoulder).minCoeff();
}

// The double embrace uses both thresholds; `body` is the single embrace's unless that is off.
void add_distance_margins(const HandDistances& d, const Mode& single, const Mode& shoulder, const Thresholds& tau,
                          DetectorResult& result) {
  const int k = frames_needed(tau.at("min_frames"));
  const Eigen::ArrayXd farther = d.left_torso.max(d.right_torso);
  result.margins["hand_dist"] = run_slack_below(tau.at("hand_dist"), d.hands, k, below(farther, tau.at("body")));
  result.margins["body"] = single.holds.empty()
                               ? run_slack_below(tau.at("body"), farther, k, below(d.hands, tau.at("hand_dist")))
                               : margin_of(single, k);
  if (!shoulder.holds.empty()) result.margins["shoulder"] = margin_of(shoulder, k);
}

}  // namespace

DetectorResult detect_hug(const Agent& performer, const Agent& partner, const Thresholds& tau,
                          const DetectorReadings& readings) {
  const HandDistances d = hand_distances(performer, partner, readings.hug_shoulder);
  const Mode modes[] = {double_mode(d, tau.at("hand_dist"), tau.at("body")),
                        single_mode(d, tau.at("body"), readings.hug_single),
                        shoulder_mode(d, tau.at("shoulder"), readings.hug_shoulder)};
  constexpr const char* kNames[] = {"double", "single", "shoulder"};
  const double min_frames = tau.at("min_frames");

  DetectorResult result;
  result.frames.assign(d.hands.size(), false);
  double overall = -std::numeric_limits<double>::infinity();
  int longest = 0;
  for (int i = 0; i < 3; ++i) {
    const std::string name = kNames[i];
    const int run = run_of(modes[i]);
    const bool embraced = !modes[i].holds.empty() && run >= min_frames;
    result.success = result.success || embraced;
    result.parts[name + "_embrace"] = embraced;
    result.values[name + "_run"] = run;
    for (const FrameMask& holds : modes[i].holds) result.frames = either(result.frames, holds);
    overall = std::max(overall, margin_of(modes[i], frames_needed(min_frames)));
    longest = std::max(longest, run);
  }
  add_values(d, result);
  add_distance_margins(d, modes[1], modes[2], tau, result);
  result.margins["min_frames"] = longest - min_frames;
  result.margins["overall"] = overall;
  return result;
}

}  // namespace duet
