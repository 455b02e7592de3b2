// Hug: the trunks are as near as two trunks come, and one of the performer's hands is round the partner: level with his
// trunk or behind it, along the line of the two trunks. A push stays before the trunk and keeps the trunks apart, hands
// that hang beside two who stand close are far from his trunk.
#include <array>
#include <limits>

#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {
namespace {

Tracks hug_rule_tracks(const Agent& performer, const Agent& partner) {
  Tracks tracks = hands_of("performer", performer);
  append(tracks, {{"performer.torso", &performer.torso}, {"partner.torso", &partner.torso}});
  return tracks;
}

// How far the hand is before the partner's trunk, along the level line from trunk to trunk; negative behind it. [m]
Eigen::ArrayXd before_trunk(const Eigen::Matrix3Xd& hand, const Agent& performer, const Agent& partner) {
  Eigen::ArrayXd before(hand.cols());
  for (Eigen::Index t = 0; t < hand.cols(); ++t) {
    const Eigen::Vector2d to_trunk = (partner.torso.col(t) - hand.col(t)).head<2>();
    before[t] = to_trunk.dot(level_direction(performer.torso.col(t), partner.torso.col(t)));
  }
  return before;
}

struct HugEvidence {
  Eigen::ArrayXd trunks;                 // (T) [m]
  std::array<Eigen::ArrayXd, 2> before;  // of the left and the right hand
  std::array<Eigen::ArrayXd, 2> reach;   // distance of the hand from the partner's trunk
};

HugEvidence evidence_of(const Agent& performer, const Agent& partner) {
  return {trunk_distances(performer, partner),
          {before_trunk(performer.lhand, performer, partner), before_trunk(performer.rhand, performer, partner)},
          {distances(performer.lhand, partner.torso), distances(performer.rhand, partner.torso)}};
}

// Frames at which a hand is round the partner.
FrameMask hand_round(const HugEvidence& e, int hand, const Thresholds& tau) {
  return both(at_most(e.before[hand], tau.at("before")), at_most(e.reach[hand], tau.at("reach")));
}

DetectorResult detect_hug_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  const HugEvidence e = evidence_of(performer, partner);
  const FrameMask close = at_most(e.trunks, tau.at("trunks"));
  const FrameMask round = either(hand_round(e, 0, tau), hand_round(e, 1, tau));
  const double hold = tau.at("hold");
  const int k = frames_needed(hold * kRateHz);

  DetectorResult result;
  result.frames = both(close, round);
  const double together = longest_run(result.frames) / kRateHz;
  result.success = together >= hold;
  result.parts = {{"trunks_close", longest_run(close) >= k}, {"hand_round", longest_run(round) >= k}};
  result.values = {{"hug_s", together},
                   {"trunks_s", longest_run(close) / kRateHz},
                   {"round_s", longest_run(round) / kRateHz},
                   {"trunks_min", e.trunks.minCoeff()},
                   {"before_min", std::min(e.before[0].minCoeff(), e.before[1].minCoeff())},
                   {"reach_min", std::min(e.reach[0].minCoeff(), e.reach[1].minCoeff())}};
  // A hand that may not count at a frame is infinitely far there.
  const auto nearer = [&](const std::array<Eigen::ArrayXd, 2>& figure, const std::array<Eigen::ArrayXd, 2>& other,
                          double limit) -> Eigen::ArrayXd {
    constexpr double kNever = std::numeric_limits<double>::max();
    return (other[0] <= limit).select(figure[0], kNever).min((other[1] <= limit).select(figure[1], kNever));
  };
  result.margins = {{"trunks", run_slack_below(tau.at("trunks"), e.trunks, k, round)},
                    {"before", run_slack_below(tau.at("before"), nearer(e.before, e.reach, tau.at("reach")), k, close)},
                    {"reach", run_slack_below(tau.at("reach"), nearer(e.reach, e.before, tau.at("before")), k, close)},
                    {"hold", together - hold}};
  return result;
}

constexpr auto kHugRule = std::to_array<RuleThreshold>({
    {"trunks", 0.45, "m", "the trunks are at most so far apart, level"},
    {"before", 0.2, "m", "a hand is at most so far before the partner's trunk, on the line of the trunks"},
    {"reach", 0.55, "m", "and at most so far from it"},
    {"hold", 0.5, "s", "all that on end for at least so long"},
});

constexpr auto kHugRuleFigures = std::to_array<DetectorFigure>({
    {"hug_s", "s", "longest time on end that the trunks are close and a hand is round the partner"},
    {"trunks_s", "s", "longest time on end that the trunks are close"},
    {"round_s", "s", "longest time on end that a hand is round the partner"},
    {"trunks_min", "m", "least distance of the trunks, level"},
    {"before_min", "m", "least by which a hand is before the partner's trunk; negative: behind it"},
    {"reach_min", "m", "least distance of a hand from the partner's trunk"},
});

}  // namespace

const ActRule kHug = {
    .thresholds = kHugRule, .figures = kHugRuleFigures, .tracks = hug_rule_tracks, .detect = detect_hug_act};

}  // namespace duet::rules
