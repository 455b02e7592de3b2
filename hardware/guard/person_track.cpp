#include "duet/hardware/guard/person_track.h"

#include <fmt/format.h>

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

}  // namespace duet
