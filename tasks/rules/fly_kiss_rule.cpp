// Fly-kiss: a hand stays at the mouth for a moment, then the same hand goes out towards the partner and stays up, while
// he stands beyond its reach. A hand that scratches a head or blocks a blow goes down again; a high-five meets a hand.
#include <algorithm>
#include <array>
#include <limits>

#include "duet/tasks/rules/act_rule.h"
#include "duet/tasks/rules/evidence.h"

namespace duet::rules {
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

}  // namespace duet::rules
