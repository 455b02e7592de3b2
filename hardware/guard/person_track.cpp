#include "duet/hardware/guard/person_track.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace duet {
namespace {

// Behind each name, for the screen.
constexpr std::array<std::string_view, kPersonFaults> kPersonFaultTexts = {
    "",
    "another message than an estimate",
    "a number that is not finite",
    "a joint further than 20 m from the camera: is its focal length the estimator's?",
    "a bone longer than 1 m",
    "a number or a picture from before the last one",
    "",
    "a picture older than 0.25 s",
    "somebody who was elsewhere a moment ago"};

}  // namespace

long refused_estimates(const PersonCounts& counts) {
  const long all = std::accumulate(counts.begin(), counts.end(), 0L);
  return all - counts[static_cast<std::size_t>(PersonFault::kNone)] -
         counts[static_cast<std::size_t>(PersonFault::kUnseen)];
}

std::string person_counts_text(const PersonCounts& counts) {
  const long used = counts[static_cast<std::size_t>(PersonFault::kNone)];
  const long unseen = counts[static_cast<std::size_t>(PersonFault::kUnseen)], refused = refused_estimates(counts);
  if (used + unseen + refused == 0) return "";
  std::string why;
  for (std::size_t k = 1; k < kPersonFaults; ++k)
    if (counts[k] > 0 && k != static_cast<std::size_t>(PersonFault::kUnseen))
      why +=
          fmt::format("{}{} {} ({})", why.empty() ? ": " : ", ", counts[k], kPersonFaultNames[k], kPersonFaultTexts[k]);
  return fmt::format("estimates: {} used, {} without anybody, {} refused{}", used, unseen, refused, why);
}

void PersonTrack::add(const HumanJoints& joints, double exposed_at, double received_at) {
  newest_ = (newest_ + 1) % kKept;
  kept_[newest_] = {exposed_at, joints};
  latency_ = received_at - exposed_at;
}

// Least squares over the pictures of the last `seconds`.
double PersonTrack::slope(double seconds) const {
  double n = 0.0, mean_t = 0.0;
  Eigen::Vector2d mean_p = Eigen::Vector2d::Zero();
  const auto each = [&](const auto& add) {
    for (const Kept& kept : kept_)
      if (kept.at >= newest_at() - seconds) add(kept.at - newest_at(), kept.joints.col(0).head<2>());
  };
  each([&](double t, const auto& p) {
    n += 1.0;
    mean_t += (t - mean_t) / n;
    mean_p += (p - mean_p) / n;
  });
  double spread = 0.0;
  Eigen::Vector2d together = Eigen::Vector2d::Zero();
  each([&](double t, const auto& p) {
    spread += (t - mean_t) * (t - mean_t);
    together += (t - mean_t) * (p - mean_p);
  });
  return spread > 0.0 ? together.norm() / spread : 0.0;
}

double PersonTrack::speed() const {
  constexpr double kLong = 0.4, kShort = 0.12;  // [s]
  return newest_at() == kNever ? 0.0 : std::max(slope(kLong), slope(kShort) - kShortNoise);
}

bool PersonTrack::at(double now, HumanJoints& joints, double most_age) const {
  if (!(now - newest_at() <= most_age)) return false;
  const double wanted = now - delay_ - latency_;
  const Kept* after = &kept_[newest_];
  for (std::size_t back = 1; back < kKept && after->at > wanted; ++back) {
    const Kept& before = kept_[(newest_ + kKept - back) % kKept];
    if (before.at == kNever) break;
    if (before.at <= wanted) {
      const double part = (wanted - before.at) / (after->at - before.at);
      joints = before.joints + part * (after->joints - before.joints);
      return true;
    }
    after = &before;
  }
  joints = after->joints;
  return true;
}

void Engagement::update(bool asks, double apart, double speed, double now) {
  if (!asks) since_ = kNever;
  if (asks && since_ == kNever) since_ = now;
  const bool may = asks && apart < kNear && now - since_ <= kLongest;
  if (!may || speed > (engaged_ ? kHurried : kCalm))
    calm_since_ = kNever;
  else if (calm_since_ == kNever)
    calm_since_ = now;
  engaged_ = calm_since_ != kNever && (engaged_ || now - calm_since_ >= kCalmTime);
}

}  // namespace duet
