#include "duet/tasks/rules/evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace duet::rules {
namespace {

constexpr int kBefore = 10;    // frames in which hands close in on one another
constexpr int kComeAndGo = 2;  // frames at either end of a meeting in which hands still come and already go

Eigen::ArrayXd heights_in(const Eigen::Matrix3Xd& hand, const FrameSpan& span) {
  return hand.row(2).segment(span.begin, span.frames()).transpose().array();
}

int turns_in(const Eigen::Matrix3Xd& hand, const FrameSpan& span) {
  return static_cast<int>(turning_points(heights_in(hand, span), kShakeTurn).size());
}

double range_of(const Eigen::Matrix3Xd& hand, const FrameSpan& span) {
  const Eigen::ArrayXd z = heights_in(hand, span);
  return z.maxCoeff() - z.minCoeff();
}

double height_over_shoulders(const Eigen::Matrix3Xd& hand, const Agent& agent, const FrameSpan& span) {
  const Eigen::ArrayXd height = hand.row(2).transpose().array() - shoulder_heights(agent);
  return height.segment(span.begin, span.frames()).mean();
}

double closing_speed(const Eigen::ArrayXd& distance, int begin) {
  double fastest = 0.0;
  for (int t = std::max(kBefore, begin - kBefore); t <= begin; ++t)
    fastest = std::max(fastest, (distance[t - kBefore] - distance[t]) * kRateHz / kBefore);
  return fastest;
}

double farthest_after(const Eigen::ArrayXd& distance, int end) {
  const Eigen::Index left = distance.size() - end;
  return left > 0 ? distance.tail(left).maxCoeff() : distance[end - 1];
}

double limit_of(const Eigen::ArrayXd& distance, const Nearness& near) {
  return std::min(near.farthest, std::max(near.contact, distance.minCoeff() + near.steady));
}

}  // namespace

Eigen::Matrix3Xd smoothed(const Eigen::Matrix3Xd& track, int window) {
  const Eigen::Index frames = track.cols(), half = window / 2;
  Eigen::Matrix3Xd mean(3, frames);
  for (Eigen::Index t = 0; t < frames; ++t) {
    const Eigen::Index side = std::min({half, t, frames - 1 - t});
    mean.col(t) = track.middleCols(t - side, 2 * side + 1).rowwise().mean();
  }
  return mean;
}

Agent smoothed(const Agent& agent) {
  return {.lhand = smoothed(agent.lhand),
          .rhand = smoothed(agent.rhand),
          .head = smoothed(agent.head),
          .root = smoothed(agent.root),
          .torso = smoothed(agent.torso),
          .lshoulder = smoothed(agent.lshoulder),
          .rshoulder = smoothed(agent.rshoulder),
          .arm = agent.arm};
}

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

std::vector<FrameSpan> spans_of(const FrameMask& mask) {
  std::vector<FrameSpan> spans;
  const int frames = static_cast<int>(mask.size());
  for (int t = 0; t < frames; ++t) {
    if (!mask[t]) continue;
    if (spans.empty() || spans.back().end != t) spans.push_back({t, t});
    spans.back().end = t + 1;
  }
  return spans;
}

FrameMask mask_of(const FrameSpan& span, Eigen::Index frames) {
  FrameMask mask(frames);
  std::fill(mask.begin() + span.begin, mask.begin() + span.end, true);
  return mask;
}

Eigen::Vector2d level_direction(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  Eigen::Vector2d direction = (to - from).head<2>();
  if (direction.norm() > 0.0) direction.normalize();
  return direction;
}

Eigen::Matrix3Xd mouth_of(const Agent& performer, const Agent& partner) {
  constexpr double kBefore = 0.17, kBelow = 0.1;  // of an arm: 10 and 6 cm of a person
  Eigen::Matrix3Xd mouth = performer.head;
  for (Eigen::Index t = 0; t < mouth.cols(); ++t) {
    mouth.col(t).head<2>() += kBefore * performer.arm * level_direction(performer.root.col(t), partner.root.col(t));
    mouth(2, t) -= kBelow * performer.arm;
  }
  return mouth;
}

Eigen::ArrayXd shoulder_heights(const Agent& agent) {
  return 0.5 * (agent.lshoulder.row(2) + agent.rshoulder.row(2)).transpose().array();
}

Eigen::ArrayXd trunk_distances(const Agent& performer, const Agent& partner) {
  return (partner.torso - performer.torso).topRows<2>().colwise().norm().transpose().array();
}

Tracks meeting_tracks(const Agent& performer, const Agent& partner) {
  Tracks tracks = hands_of("performer", performer);
  append(tracks, hands_of("partner", partner));
  append(tracks, {{"performer.torso", &performer.torso},
                  {"performer.lshoulder", &performer.lshoulder},
                  {"performer.rshoulder", &performer.rshoulder},
                  {"partner.torso", &partner.torso},
                  {"partner.lshoulder", &partner.lshoulder},
                  {"partner.rshoulder", &partner.rshoulder}});
  return tracks;
}

std::vector<HandMeeting> hand_meetings(const Agent& performer, const Agent& partner, const Nearness& near) {
  std::vector<HandMeeting> meetings;
  const Eigen::ArrayXd trunks = trunk_distances(performer, partner);
  for (const bool own_right : {false, true}) {
    for (const bool other_right : {false, true}) {
      const Eigen::Matrix3Xd& own = own_right ? performer.rhand : performer.lhand;
      const Eigen::Matrix3Xd& other = other_right ? partner.rhand : partner.lhand;
      const Eigen::ArrayXd distance = distances(own, other);
      for (const FrameSpan& span : spans_of(below(distance, limit_of(distance, near)))) {
        const int edge = std::min(kComeAndGo, (span.frames() - 1) / 2);
        const FrameSpan inside{span.begin + edge, span.end - edge};
        meetings.push_back({.span = span,
                            .performer_right = own_right,
                            .partner_right = other_right,
                            .nearest = distance.segment(span.begin, span.frames()).minCoeff(),
                            .turns = std::min(turns_in(own, span), turns_in(other, span)),
                            .shake = std::min(range_of(own, inside), range_of(other, inside)),
                            .travel = std::max(range_of(own, span), range_of(other, span)),
                            .own_height = height_over_shoulders(own, performer, span),
                            .other_height = height_over_shoulders(other, partner, span),
                            .trunks = trunks.segment(span.begin, span.frames()).mean(),
                            .closing = closing_speed(distance, span.begin),
                            .parted = farthest_after(distance, span.end)});
      }
    }
  }
  return meetings;
}

}  // namespace duet::rules

namespace duet {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <typename Predicate>
FrameMask mask_of(const Eigen::ArrayXd& values, Predicate holds) {
  FrameMask mask(values.size());
  for (Eigen::Index t = 0; t < values.size(); ++t) mask[t] = holds(values[t]);
  return mask;
}

template <typename Operation>
FrameMask combine(const FrameMask& a, const FrameMask& b, Operation operation) {
  FrameMask mask(a.size());
  for (size_t t = 0; t < a.size(); ++t) mask[t] = operation(a[t], b[t]);
  return mask;
}

// Smallest maximum over windows of k allowed frames, infinity where there is none.
double smallest_window_max(const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  const int frames = static_cast<int>(values.size());
  double smallest = kInfinity;
  int run = 0;
  for (int t = 0; t < frames; ++t) {
    run = allowed[t] ? run + 1 : 0;
    if (run < k || values[t] >= smallest) continue;
    smallest = std::min(smallest, values.segment(t - k + 1, k).maxCoeff());
  }
  return smallest;
}

double kth_smallest(const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  std::vector<double> kept;
  for (Eigen::Index t = 0; t < values.size(); ++t)
    if (allowed[t]) kept.push_back(values[t]);
  if (static_cast<int>(kept.size()) < k) return kInfinity;
  std::nth_element(kept.begin(), kept.begin() + (k - 1), kept.end());
  return kept[k - 1];
}

template <typename Figure>
double slack(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed, Figure figure) {
  const double with_others = figure(values, k, allowed);
  return threshold - (with_others < kInfinity ? with_others : figure(values, k, FrameMask(values.size(), true)));
}

}  // namespace

int longest_run(const FrameMask& mask) {
  int longest = 0;
  int run = 0;
  for (const bool holds : mask) {
    run = holds ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest;
}

int count_frames(const FrameMask& mask) { return static_cast<int>(std::count(mask.begin(), mask.end(), true)); }

FrameMask both(const FrameMask& a, const FrameMask& b) {
  return combine(a, b, [](bool x, bool y) { return x && y; });
}
FrameMask either(const FrameMask& a, const FrameMask& b) {
  return combine(a, b, [](bool x, bool y) { return x || y; });
}

FrameMask below(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x < threshold; });
}
FrameMask at_most(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x <= threshold; });
}
FrameMask above(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x > threshold; });
}
FrameMask at_least(const Eigen::ArrayXd& values, double threshold) {
  return mask_of(values, [=](double x) { return x >= threshold; });
}

int frames_needed(double threshold) {
  constexpr double kMost = 1e9;  // more than any clip has; keeps the conversion defined
  return static_cast<int>(std::clamp(std::ceil(threshold), 1.0, kMost));
}

double run_slack_below(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return slack(threshold, values, k, allowed, smallest_window_max);
}
double run_slack_above(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return run_slack_below(-threshold, -values, k, allowed);
}
double count_slack_below(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return slack(threshold, values, k, allowed, kth_smallest);
}
double count_slack_above(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed) {
  return count_slack_below(-threshold, -values, k, allowed);
}

}  // namespace duet
