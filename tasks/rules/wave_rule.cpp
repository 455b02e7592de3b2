// Wave: a raised hand swings to and fro, several times on end at 0.8 to 5 Hz, about a bent elbow: across the arm, so
// that its distance from the shoulder changes less than its place. A punch goes out and back along the arm.
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

constexpr int kDrift = 51;  // frames of the moving mean that is taken off: a second

Tracks wave_rule_tracks(const Agent& performer, const Agent&) {
  Tracks tracks = hands_of("performer", performer);
  append(tracks, {{"performer.lshoulder", &performer.lshoulder}, {"performer.rshoulder", &performer.rshoulder}});
  return tracks;
}

// Swings on end of one hand.
struct SwingChain {
  int swings = 0;
  FrameSpan span;
  double across = 0.0;  // least way of a swing [m]
  double radial = 0.0;  // range of the distance from the shoulder, of the range of the way [1]
};

struct TurningPoint {
  int frame = 0;
  double place = 0.0;
};

// The hand's place along its main direction. [m]
Eigen::ArrayXd main_motion(const Eigen::Matrix3Xd& hand) {
  const Eigen::Matrix3Xd moving = hand - smoothed(hand, kDrift);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moving * moving.transpose());
  return (solver.eigenvectors().col(2).transpose() * moving).transpose().array();
}

// Places where the motion turns back by `least` or more; the ends are not.
std::vector<TurningPoint> turning_points(const Eigen::ArrayXd& place, double least) {
  std::vector<TurningPoint> points;
  TurningPoint low{0, place[0]}, high{0, place[0]};
  int heading = 0;
  for (int t = 1; t < static_cast<int>(place.size()); ++t) {
    if (place[t] > high.place) high = {t, place[t]};
    if (place[t] < low.place) low = {t, place[t]};
    if (heading >= 0 && high.place - place[t] >= least) {
      points.push_back(high);
      heading = -1;
      low = {t, place[t]};
    } else if (heading <= 0 && place[t] - low.place >= least) {
      points.push_back(low);
      heading = 1;
      high = {t, place[t]};
    }
  }
  return points;
}

double range_in(const Eigen::ArrayXd& values, const FrameSpan& span) {
  const auto part = values.segment(span.begin, span.frames());
  return part.maxCoeff() - part.minCoeff();
}

// The longest chain of swings in a span of frames where the hand is up.
SwingChain longest_chain(const Eigen::Matrix3Xd& hand, const Eigen::Matrix3Xd& shoulder, const FrameSpan& up,
                         const Thresholds& tau) {
  const Eigen::ArrayXd place = main_motion((hand - shoulder).middleCols(up.begin, up.frames()));
  const Eigen::ArrayXd arm = distances(hand, shoulder).segment(up.begin, up.frames());
  const std::vector<TurningPoint> points = turning_points(place, tau.at("swing"));
  SwingChain best;
  std::size_t first = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    if ((points[i].frame - points[i - 1].frame) / kRateHz > tau.at("slowest")) first = i;
    const int swings = static_cast<int>(i - first);
    if (swings <= best.swings) continue;
    const FrameSpan inside{points[first].frame, points[i].frame + 1};
    best.swings = swings;
    best.span = {up.begin + inside.begin, up.begin + inside.end};
    best.radial = range_in(arm, inside) / range_in(place, inside);
    best.across = std::numeric_limits<double>::max();
    for (std::size_t j = first + 1; j <= i; ++j)
      best.across = std::min(best.across, std::abs(points[j].place - points[j - 1].place));
  }
  return best;
}

bool is_wave(const SwingChain& chain, const Thresholds& tau) {
  return chain.swings >= tau.at("swings") && chain.radial <= tau.at("radial");
}

// A wave before none, then the longer one.
SwingChain best_chain(const Agent& performer, const Thresholds& tau) {
  SwingChain best;
  for (const bool right : {false, true}) {
    const Eigen::Matrix3Xd& hand = right ? performer.rhand : performer.lhand;
    const Eigen::Matrix3Xd& shoulder = right ? performer.rshoulder : performer.lshoulder;
    const Eigen::ArrayXd height = hand.row(2).transpose().array() - shoulder_heights(performer);
    for (const FrameSpan& up : spans_of(at_least(height, tau.at("height")))) {
      const SwingChain chain = longest_chain(hand, shoulder, up, tau);
      const bool better = is_wave(chain, tau) != is_wave(best, tau) ? is_wave(chain, tau) : chain.swings > best.swings;
      if (better) best = chain;
    }
  }
  return best;
}

double highest_hand(const Agent& performer) {
  return (performer.lhand.row(2).cwiseMax(performer.rhand.row(2)).transpose().array() - shoulder_heights(performer))
      .maxCoeff();
}

DetectorResult detect_wave_act(const Agent& raw_performer, const Agent&, const Thresholds& tau) {
  const Agent performer = smoothed(raw_performer);
  const SwingChain chain = best_chain(performer, tau);
  DetectorResult result;
  result.frames = mask_of(chain.span, performer.lhand.cols());
  result.parts = {{"swings", chain.swings >= tau.at("swings")},
                  {"bent_elbow", chain.swings > 0 && chain.radial <= tau.at("radial")}};
  result.success = is_wave(chain, tau);
  result.values = {{"swings", chain.swings},
                   {"swing_min", chain.across},
                   {"radial", chain.radial},
                   {"waving_s", chain.span.seconds()},
                   {"height", highest_hand(performer)}};
  result.margins = {{"swings", chain.swings - tau.at("swings")}, {"radial", tau.at("radial") - chain.radial}};
  return result;
}

constexpr auto kWaveRule = std::to_array<RuleThreshold>({
    {"height", -0.2, "m", "the hand is at least so high over the shoulders all the while"},
    {"swing", 0.06, "m", "a swing is at least so long"},
    {"slowest", 0.65, "s", "and takes at most so long"},
    {"swings", 4, "1", "swings on end, at least"},
    {"radial", 0.6, "1", "the distance from the shoulder changes by at most this share of the way across"},
});

constexpr auto kWaveRuleFigures = std::to_array<DetectorFigure>({
    {"swings", "1", "swings on end of a raised hand"},
    {"swing_min", "m", "the least way of them"},
    {"radial", "1", "change of the distance from the shoulder, as a share of the way across"},
    {"waving_s", "s", "how long they last"},
    {"height", "m", "largest height of the higher hand over the shoulders"},
});

}  // namespace

const ActRule kWave = {
    .thresholds = kWaveRule, .figures = kWaveRuleFigures, .tracks = wave_rule_tracks, .detect = detect_wave_act};

}  // namespace duet::rules
