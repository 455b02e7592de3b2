// Bow: somebody who stands upright inclines the trunk towards the partner, far enough and for a moment, and comes up
// again, at a distance from him. A kick leans back or to the side, a hug leans at no distance.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {
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

}  // namespace duet::rules
