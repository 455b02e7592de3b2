// Rules of gestures at a distance: fly-kiss and wave.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <limits>

#include "duet/tasks/rules/agent.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {

// Fly-kiss: a hand stays at the mouth for a moment, then the same hand goes out towards the partner and stays up, while
// he stands beyond its reach. A hand that scratches a head or blocks a blow goes down again; a high-five meets a hand.

namespace {

Tracks fly_kiss_rule_tracks(const Agent& performer, const Agent& partner) {
  Tracks tracks = hands_of("performer", performer);
  append(tracks, hands_of("partner", partner));
  append(tracks, {{"performer.head", &performer.head},
                  {"performer.torso", &performer.torso},
                  {"partner.torso", &partner.torso},
                  {"performer.root", &performer.root},
                  {"performer.lshoulder", &performer.lshoulder},
                  {"performer.rshoulder", &performer.rshoulder},
                  {"partner.root", &partner.root}});
  return tracks;
}

// The motion of one hand, per frame. [m], but `out` in arms
struct KissHand {
  Eigen::ArrayXd to_mouth, out, height, to_hands, trunks;
};

KissHand kiss_hand(const Agent& performer, const Agent& partner, bool right) {
  const Eigen::Matrix3Xd& hand = right ? performer.rhand : performer.lhand;
  const Eigen::Matrix3Xd& shoulder = right ? performer.rshoulder : performer.lshoulder;
  KissHand kiss{distances(hand, mouth_of(performer, partner)), Eigen::ArrayXd(hand.cols()), Eigen::ArrayXd(hand.cols()),
                distances(hand, partner.lhand).min(distances(hand, partner.rhand)),
                trunk_distances(performer, partner)};
  for (Eigen::Index t = 0; t < hand.cols(); ++t) {
    const Eigen::Vector2d ahead = level_direction(performer.root.col(t), partner.root.col(t));
    const Eigen::Vector3d arm = hand.col(t) - shoulder.col(t);
    kiss.out[t] = arm.head<2>().dot(ahead) / performer.arm;
    kiss.height[t] = arm.z() / performer.arm;
  }
  return kiss;
}

struct Kiss {
  FrameSpan mouth = {};                                 // that the hand is at the mouth
  int sent = 0;                                         // the frame after which it is out, 0 where it never is
  double nearest = std::numeric_limits<double>::max();  // to the mouth [m]
  double out = 0.0;                                     // farthest after the mouth, of its arm's length [1]
  double apart = 0.0;                                   // least level distance of the trunks from mouth to sent [m]
  double to_hands = 0.0;  // least distance from the partner's hands from mouth to sent [m]
};

bool is_kiss(const Kiss& kiss, const Thresholds& tau) {
  return kiss.mouth.seconds() >= tau.at("stays") && kiss.out >= tau.at("out") && kiss.to_hands >= tau.at("clear") &&
         kiss.apart >= tau.at("apart");
}

// From the mouth the hand goes out within the time; the best of the hand's visits.
Kiss best_kiss(const KissHand& hand, const Thresholds& tau) {
  Kiss best{.nearest = hand.to_mouth.minCoeff()};
  const int frames = static_cast<int>(hand.to_mouth.size());
  for (const FrameSpan& mouth : spans_of(at_most(hand.to_mouth, tau.at("mouth")))) {
    Kiss kiss{.mouth = mouth, .sent = mouth.end, .nearest = best.nearest};
    const int last = std::min(frames, mouth.end + static_cast<int>(tau.at("within") * kRateHz));
    for (int t = mouth.end; t < last; ++t)
      if (hand.height[t] >= tau.at("height") && hand.out[t] > kiss.out) {
        kiss.out = hand.out[t];
        kiss.sent = t + 1;
      }
    kiss.to_hands = hand.to_hands.segment(mouth.begin, kiss.sent - mouth.begin).minCoeff();
    kiss.apart = hand.trunks.segment(mouth.begin, kiss.sent - mouth.begin).minCoeff();
    const bool better = is_kiss(kiss, tau) != is_kiss(best, tau) ? is_kiss(kiss, tau) : kiss.out > best.out;
    if (better) best = kiss;
  }
  return best;
}

DetectorResult detect_fly_kiss_act(const Agent& performer, const Agent& partner, const Thresholds& tau) {
  const Kiss left = best_kiss(kiss_hand(performer, partner, false), tau);
  const Kiss right = best_kiss(kiss_hand(performer, partner, true), tau);
  const bool take_right = is_kiss(left, tau) != is_kiss(right, tau) ? is_kiss(right, tau) : right.out >= left.out;
  const Kiss& kiss = take_right ? right : left;
  DetectorResult result;
  result.frames = mask_of({kiss.mouth.begin, std::max(kiss.sent, kiss.mouth.end)}, performer.head.cols());
  result.success = is_kiss(kiss, tau);
  result.parts = {{"at_the_mouth", kiss.mouth.seconds() >= tau.at("stays")},
                  {"sent", kiss.out >= tau.at("out")},
                  {"clear", kiss.to_hands >= tau.at("clear") && kiss.apart >= tau.at("apart")}};
  result.values = {{"mouth_min", std::min(left.nearest, right.nearest)},
                   {"mouth_s", kiss.mouth.seconds()},
                   {"out", kiss.out},
                   {"hands_min", kiss.to_hands},
                   {"trunks", kiss.apart}};
  result.margins = {{"stays", kiss.mouth.seconds() - tau.at("stays")},
                    {"out", kiss.out - tau.at("out")},
                    {"clear", kiss.to_hands - tau.at("clear")},
                    {"apart", kiss.apart - tau.at("apart")}};
  return result;
}

constexpr auto kFlyKissRule = std::to_array<RuleThreshold>({
    {"mouth", 0.17, "m", "a hand is at the mouth while at most so far from it"},
    {"stays", 0.2, "s", "it stays there so long on end"},
    {"within", 2.0, "s", "and then, within this,"},
    {"out", 0.55, "arm", "it comes so far out from its shoulder, level, towards the partner"},
    {"height", -0.3, "arm", "while so high over its shoulder"},
    {"apart", 0.6, "m", "the trunks are so far apart meanwhile"},
    {"clear", 0.3, "m", "from mouth to end it stays so far from the partner's hands"},
});

constexpr auto kFlyKissRuleFigures = std::to_array<DetectorFigure>({
    {"mouth_min", "m", "least distance of a hand from the mouth"},
    {"mouth_s", "s", "how long the hand stays at the mouth"},
    {"out", "1", "how far it comes out towards the partner after that, of an arm's length"},
    {"hands_min", "m", "least distance from the partner's hands meanwhile"},
    {"trunks", "m", "least level distance of the trunks meanwhile"},
});

}  // namespace

const ActRule kFlyKiss = {.thresholds = kFlyKissRule,
                          .figures = kFlyKissRuleFigures,
                          .tracks = fly_kiss_rule_tracks,
                          .detect = detect_fly_kiss_act};

// Wave: one raised hand swings to and fro, several times on end at 0.6 Hz and faster, and comes back to where it began,
// clear of the partner. The way up and the way down are no swings; who pushes or punches is near the partner or has
// both hands up. A hand that is held up and waves from the wrist alone is not seen: its track stands still (five of
// Kinder's twenty).
//
// A swing is the way between two turning points of the hand along its main direction, slow drifts taken off.

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
