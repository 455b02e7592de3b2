// Rules of acts of the trunk: bow and hug.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {

// Bow: somebody who stands upright inclines the trunk towards the partner, far enough and for a moment, and comes up
// again, at a distance from him. A kick leans back or to the side, a hug leans at no distance.

namespace {

Tracks bend_rule_tracks(const Agent& performer, const Agent& partner) {
  return {{"performer.head", &performer.head},
          {"performer.root", &performer.root},
          {"performer.torso", &performer.torso},
          {"partner.root", &partner.root},
          {"partner.torso", &partner.torso}};
}

// Inclination of the line from root to head: towards the partner, and to the side of that. (T) each [rad]
struct Lean {
  Eigen::ArrayXd forward, sideways;
};

Lean lean_of(const Agent& performer, const Agent& partner) {
  const Eigen::Index frames = performer.head.cols();
  Lean lean{Eigen::ArrayXd(frames), Eigen::ArrayXd(frames)};
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Vector3d trunk = performer.head.col(t) - performer.root.col(t);
    const Eigen::Vector2d ahead = level_direction(performer.root.col(t), partner.root.col(t));
    lean.forward[t] = std::atan2(trunk.head<2>().dot(ahead), trunk.z());
    lean.sideways[t] = std::atan2(std::abs(trunk.x() * ahead.y() - trunk.y() * ahead.x()), trunk.z());
  }
  return lean;
}

struct Bow {
  FrameSpan span;
  double angle = 0.0;                // largest [rad]
  double before = 0.0, after = 0.0;  // least inclination before and after [rad]
  double sideways = 0.0;             // where it is largest [rad]
  double apart = 0.0;                // least level distance of the trunks meanwhile [m]
};

struct BowRoom {
  double angle, lasts, upright, sideways, apart;  // by how much each condition holds
  [[nodiscard]] double least() const { return std::min({angle, lasts, upright, sideways, apart}); }
};

BowRoom room_of(const Bow& bow, const Thresholds& tau) {
  return {bow.angle - tau.at("angle"), bow.span.seconds() - tau.at("lasts"),
          tau.at("upright") - std::max(bow.before, bow.after), tau.at("sideways") - bow.sideways,
          bow.apart - tau.at("apart")};
}

// The deepest of those that meet every condition, else the deepest.
Bow best_bow(const Lean& lean, const Eigen::ArrayXd& trunks, const Thresholds& tau) {
  Bow best;
  bool found = false;
  for (const FrameSpan& span : spans_of(at_least(lean.forward, tau.at("angle")))) {
    Eigen::Index deepest = 0;
    Bow bow{.span = span, .angle = lean.forward.segment(span.begin, span.frames()).maxCoeff(&deepest)};
    bow.before = lean.forward.head(span.begin + 1).minCoeff();
    bow.after = lean.forward.tail(lean.forward.size() - span.end + 1).minCoeff();
    bow.sideways = lean.sideways[span.begin + deepest];
    bow.apart = trunks.segment(span.begin, span.frames()).minCoeff();
    const bool meets = room_of(bow, tau).least() >= 0.0;
    if (meets == found ? bow.angle > best.angle : meets) best = bow;
    found = found || meets;
  }
  if (best.span.frames() == 0) best.angle = lean.forward.maxCoeff();
  return best;
}

DetectorResult detect_bend_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  const Bow bow = best_bow(lean_of(performer, partner), trunk_distances(performer, partner), tau);
  const BowRoom room = room_of(bow, tau);
  DetectorResult result;
  result.frames = mask_of(bow.span, performer.head.cols());
  result.success = room.least() >= 0.0;
  result.parts = {{"bows", room.angle >= 0.0 && room.lasts >= 0.0 && room.sideways >= 0.0},
                  {"returns", room.upright >= 0.0},
                  {"apart", room.apart >= 0.0}};
  result.values = {{"angle", bow.angle}, {"bow_s", bow.span.seconds()}, {"before", bow.before},
                   {"after", bow.after}, {"sideways", bow.sideways},    {"trunks", bow.apart}};
  result.margins = {{"angle", room.angle},
                    {"lasts", room.lasts},
                    {"upright", room.upright},
                    {"sideways", room.sideways},
                    {"apart", room.apart}};
  return result;
}

constexpr double kDegree = std::numbers::pi / 180.0;

constexpr auto kBendRule = std::to_array<RuleThreshold>({
    {"angle", 30 * kDegree, "rad", "the line from root to head is inclined towards the partner by at least"},
    {"lasts", 0.1, "s", "for so long on end"},
    {"upright", 15 * kDegree, "rad", "at some time before and after it is inclined by at most"},
    {"sideways", 35 * kDegree, "rad", "where it is deepest, it is inclined to the side by at most"},
    {"apart", 0.45, "m", "the trunks are at least so far apart meanwhile"},
});

constexpr auto kBendRuleFigures = std::to_array<DetectorFigure>({
    {"angle", "rad", "largest inclination towards the partner"},
    {"bow_s", "s", "how long it is as large as asked for"},
    {"before", "rad", "least inclination before"},
    {"after", "rad", "least inclination afterwards"},
    {"sideways", "rad", "inclination to the side where it is deepest"},
    {"trunks", "m", "least level distance of the trunks meanwhile"},
});

}  // namespace

const ActRule kBend = {
    .thresholds = kBendRule, .figures = kBendRuleFigures, .tracks = bend_rule_tracks, .detect = detect_bend_act};

// Hug: the trunks are as near as two trunks come, and one of the performer's hands is round the partner: level with his
// trunk or behind it, along the line of the two trunks. A push stays before the trunk and keeps the trunks apart, hands
// that hang beside two who stand close are far from his trunk.

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
