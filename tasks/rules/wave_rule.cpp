// Wave: one raised hand swings to and fro, several times on end at 0.6 Hz and faster, and comes back to where it began,
// clear of the partner. The way up and the way down are no swings; who pushes or punches is near the partner or has
// both hands up. A hand that is held up and waves from the wrist alone is not seen: its track stands still (five of
// Kinder's twenty).
//
// A swing is the way between two turning points of the hand along its main direction, slow drifts taken off.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <limits>

#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {
namespace {

constexpr int kDrift = 41;  // frames of the moving mean that is taken off
constexpr int kComes = 8;   // frames at either end of the time that a hand is up in which it comes and goes
constexpr int kLeast = 15;  // frames that can be judged

Tracks wave_rule_tracks(const Agent& performer, const Agent& partner) {
  Tracks tracks = hands_of("performer", performer);
  append(tracks, {{"performer.lshoulder", &performer.lshoulder}, {"performer.rshoulder", &performer.rshoulder}});
  append(tracks, hands_of("partner", partner));
  append(tracks, {{"performer.head", &performer.head},
                  {"performer.root", &performer.root},
                  {"performer.torso", &performer.torso},
                  {"partner.root", &partner.root}});
  append(tracks, {{"partner.torso", &partner.torso}, {"partner.head", &partner.head}});
  return tracks;
}

// Swings on end of one hand.
struct SwingChain {
  int swings = 0;
  FrameSpan span = {};
  double across = 0.0;  // least way of a swing [m]
  double back = 0.0;    // distance of its end from its begin, of an arm's length [1]
  double clear = 0.0;   // least distance of the hand from the partner's trunk, head and hands [m]
  double body = 0.0;    // likewise from the own mouth and heart, of an arm's length [1]
  double other = 0.0;   // mean height of the other hand over the shoulders, of an arm's length [1]
};

// The hand's place along its main direction. [m]
Eigen::ArrayXd main_motion(const Eigen::Matrix3Xd& hand) {
  const Eigen::Matrix3Xd moving = hand - smoothed(hand, kDrift);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moving * moving.transpose());
  return (solver.eigenvectors().col(2).transpose() * moving).transpose().array();
}

// One person's hand beside the partner: what a chain of swings is judged by.
struct WavingHand {
  Eigen::Matrix3Xd from_shoulder;               // (3, T) [m]
  Eigen::ArrayXd height, other, partner, body;  // (T) in arms, but the partner in [m]
};

WavingHand waving_hand(const Agent& performer, const Agent& partner, bool right) {
  const Eigen::Matrix3Xd& hand = right ? performer.rhand : performer.lhand;
  const Eigen::Matrix3Xd& other = right ? performer.lhand : performer.rhand;
  const Eigen::ArrayXd shoulders = shoulder_heights(performer);
  WavingHand waving;
  waving.from_shoulder = hand - (right ? performer.rshoulder : performer.lshoulder);
  waving.height = (hand.row(2).transpose().array() - shoulders) / performer.arm;
  waving.other = (other.row(2).transpose().array() - shoulders) / performer.arm;
  waving.partner = distances(hand, partner.torso)
                       .min(distances(hand, partner.head))
                       .min(distances(hand, partner.lhand))
                       .min(distances(hand, partner.rhand));
  waving.body = distances(hand, mouth_of(performer, partner)).min(distances(hand, performer.torso)) / performer.arm;
  return waving;
}

SwingChain chain_of(const WavingHand& hand, const std::vector<TurningPoint>& points, std::size_t first,
                    std::size_t last, int begin, double arm) {
  SwingChain chain{.swings = static_cast<int>(last - first)};
  chain.span = {begin + points[first].frame, begin + points[last].frame + 1};
  const auto part = [&](const Eigen::ArrayXd& values) { return values.segment(chain.span.begin, chain.span.frames()); };
  chain.across = std::numeric_limits<double>::max();
  for (std::size_t j = first + 1; j <= last; ++j)
    chain.across = std::min(chain.across, std::abs(points[j].place - points[j - 1].place));
  chain.back = (hand.from_shoulder.col(chain.span.end - 1) - hand.from_shoulder.col(chain.span.begin)).norm() / arm;
  chain.clear = part(hand.partner).minCoeff();
  chain.body = part(hand.body).minCoeff();
  chain.other = part(hand.other).mean();
  return chain;
}

bool is_wave(const SwingChain& chain, const Thresholds& tau) {
  return chain.swings >= tau.at("swings") && chain.back <= tau.at("back") && chain.clear >= tau.at("clear") &&
         chain.body >= tau.at("body") && chain.other <= tau.at("other");
}

// A wave before none, then the longer one.
bool is_better(const SwingChain& chain, const SwingChain& best, const Thresholds& tau) {
  return is_wave(chain, tau) != is_wave(best, tau) ? is_wave(chain, tau) : chain.swings > best.swings;
}

// The longest chain of swings in a span of frames where the hand is up.
SwingChain longest_chain(const WavingHand& hand, FrameSpan up, double arm, const Thresholds& tau) {
  const int frames = static_cast<int>(hand.height.size());
  if (up.begin > 0) up.begin += kComes;
  if (up.end < frames) up.end -= kComes;
  SwingChain best;
  if (up.frames() < kLeast) return best;
  const Eigen::ArrayXd place = main_motion(hand.from_shoulder.middleCols(up.begin, up.frames()));
  const std::vector<TurningPoint> points = turning_points(place, tau.at("swing"));
  std::size_t first = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    if ((points[i].frame - points[i - 1].frame) / kRateHz > tau.at("slowest")) first = i;
    if (i == first) continue;
    const SwingChain chain = chain_of(hand, points, first, i, up.begin, arm);
    if (is_better(chain, best, tau)) best = chain;
  }
  return best;
}

SwingChain best_chain(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  SwingChain best;
  for (const bool right : {false, true}) {
    const WavingHand hand = waving_hand(performer, partner, right);
    for (const FrameSpan& up : spans_of(at_least(hand.height, tau.at("height")))) {
      const SwingChain chain = longest_chain(hand, up, performer.arm, tau);
      if (is_better(chain, best, tau)) best = chain;
    }
  }
  return best;
}

double highest_hand(const Agent& performer) {
  return (performer.lhand.row(2).cwiseMax(performer.rhand.row(2)).transpose().array() - shoulder_heights(performer))
      .maxCoeff();
}

DetectorResult detect_wave_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  const SwingChain chain = best_chain(performer, partner, tau);
  DetectorResult result;
  result.frames = mask_of(chain.span, performer.lhand.cols());
  result.parts = {{"swings", chain.swings >= tau.at("swings")},
                  {"returns", chain.swings > 0 && chain.back <= tau.at("back")},
                  {"clear", chain.clear >= tau.at("clear") && chain.body >= tau.at("body")},
                  {"one_hand", chain.swings > 0 && chain.other <= tau.at("other")}};
  result.success = is_wave(chain, tau);
  result.values = {{"swings", chain.swings},
                   {"swing_min", chain.across},
                   {"waving_s", chain.span.seconds()},
                   {"back", chain.back},
                   {"clear", chain.clear},
                   {"body", chain.body},
                   {"other", chain.other},
                   {"height", highest_hand(performer)}};
  result.margins = {{"swings", chain.swings - tau.at("swings")},
                    {"back", tau.at("back") - chain.back},
                    {"clear", chain.clear - tau.at("clear")},
                    {"body", chain.body - tau.at("body")},
                    {"other", tau.at("other") - chain.other}};
  return result;
}

constexpr auto kWaveRule = std::to_array<RuleThreshold>({
    {"height", -0.3, "arm", "the hand is at least so high over the shoulders all the while"},
    {"swing", 0.03, "m", "a swing is at least so long"},
    {"slowest", 0.8, "s", "and takes at most so long"},
    {"swings", 3, "1", "swings on end, at least"},
    {"back", 0.65, "arm", "the hand ends at most so far from where it began"},
    {"clear", 0.45, "m", "it stays so far from the partner's trunk, head and hands"},
    {"body", 0.3, "arm", "and so far from the own mouth and heart"},
    {"other", -0.3, "arm", "the other hand is at most so high over the shoulders"},
});

constexpr auto kWaveRuleFigures = std::to_array<DetectorFigure>({
    {"swings", "1", "swings on end of a raised hand"},
    {"swing_min", "m", "the least way of them"},
    {"waving_s", "s", "how long they last"},
    {"back", "1", "distance of the hand's last place from its first, of an arm's length"},
    {"clear", "m", "least distance of the hand from the partner's trunk, head and hands"},
    {"body", "1", "least distance of the hand from the own mouth and heart, of an arm's length"},
    {"other", "1", "mean height of the other hand over the shoulders, of an arm's length"},
    {"height", "m", "largest height of the higher hand over the shoulders"},
});

}  // namespace

const ActRule kWave = {
    .thresholds = kWaveRule, .figures = kWaveRuleFigures, .tracks = wave_rule_tracks, .detect = detect_wave_act};

}  // namespace duet::rules
