#include "duet/experiment/plan/episode_costs.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace duet {

std::string cost_name(const EpisodeSpec& spec) { return fmt::format("{}/{}", spec.engine, spec.controller->name); }

double motion_seconds(const EpisodeSpec& spec) {
  if (spec.reference != nullptr) return spec.reference->seconds;
  return static_cast<double>(spec.clip->robot.frames()) / spec.clip->robot.rate_hz;
}

void EpisodeCosts::expect(const EpisodeSpec& spec) {
  const std::lock_guard lock(mutex_);
  work_[cost_name(spec)].left += motion_seconds(spec);
}

void EpisodeCosts::ended(const EpisodeSpec& spec, double wall_s) {
  const double motion = motion_seconds(spec);
  const std::lock_guard lock(mutex_);
  Work& work = work_[cost_name(spec)];
  work.left = std::max(work.left - motion, 0.0);
  work.done += motion;
  work.wall += wall_s;
}

double EpisodeCosts::share_done() const {
  const std::lock_guard lock(mutex_);
  double done = 0.0, left = 0.0;
  for (const auto& [name, work] : work_) {
    if (work.done == 0.0 && work.left > 0.0) return std::numeric_limits<double>::quiet_NaN();
    done += work.wall;
    if (work.done > 0.0) left += work.wall / work.done * work.left;
  }
  return done > 0.0 ? done / (done + left) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace duet
