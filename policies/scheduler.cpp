#include "duet/policies/scheduler.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "duet/core/require.h"
#include "duet/core/robot_state.h"

namespace duet {
namespace {

constexpr double kUnitTolerance = 1e-6;

double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

// The plan's reference at `tick`; its last one stands for everything after it.
const Reference& entry(const std::vector<Reference>& plan, int start, int tick) {
  return plan[static_cast<std::size_t>(std::clamp(tick - start, 0, static_cast<int>(plan.size()) - 1))];
}

// Messages are made only on failure: a plan has a hundred references.
void check(const Reference& reference, const char* what) {
  const bool finite = reference.X_WB.p.allFinite() && reference.X_WB.R.coeffs().allFinite() && reference.q.allFinite();
  if (!finite) throw std::invalid_argument(fmt::format("scheduler: {} holds a number that is not finite", what));
  const double norm = reference.X_WB.R.norm();
  if (std::abs(norm - 1.0) > kUnitTolerance)
    throw std::invalid_argument(fmt::format("scheduler: {}: expected a quaternion of norm 1, found {}", what, norm));
}

}  // namespace

Scheduler::Scheduler(const SchedulerOptions& options) : options_(options) {
  const auto check_ticks = [](const char* name, int ticks) {
    require(1 <= ticks && ticks <= kMostFuseTicks, "scheduler: expected {} in 1..{}, found {}", name, kMostFuseTicks,
            ticks);
  };
  check_ticks("fuse_ticks", options.fuse_ticks);
  check_ticks("late_after_ticks", options.late_after_ticks);
  require(options.max_root_speed > 0.0, "scheduler: expected max_root_speed > 0, found {}", options.max_root_speed);
  require(options.max_root_yaw_rate > 0.0, "scheduler: expected max_root_yaw_rate > 0, found {}",
          options.max_root_yaw_rate);
  require(options.late_factor > 0.0 && options.late_factor <= 1.0,
          "scheduler: expected late_factor in (0, 1], found {}", options.late_factor);
}

void Scheduler::reset(const Reference& start) {
  check(start, "start");
  last_ = target_ = start;
  old_plan_.clear();
  plan_.clear();
  started_ = true;
  asked_ = late_ = tightened_ = false;
  late_ticks_ = 0;
}

void Scheduler::push(const Anchors& anchors, int tick) {
  for (const Reference& anchor : anchors) check_plan(anchor);
  push(densify(anchors), tick);
}

void Scheduler::push(std::vector<Reference> plan, int tick) {
  require(!plan.empty(), "scheduler: expected a plan with references, found none");
  for (const Reference& reference : plan) check_plan(reference);
  require(plan_.empty() || tick > plan_start_, "scheduler: expected a plan made after tick {}, found {}", plan_start_,
          tick);
  require(!asked_ || tick <= tick_ + 1, "scheduler: expected a plan made at tick {} or before, found {}", tick_ + 1,
          tick);
  const int next = asked_ ? tick_ + 1 : tick;
  std::vector<Reference> before;
  if (plan_.empty() || late_) {
    before.push_back(last_);  // what is held fades into the new plan
  } else {
    for (int t = next; t < next + options_.fuse_ticks; ++t) fuse(t, before.emplace_back());
  }
  tightened_ = late_;
  old_plan_ = std::move(before);
  old_start_ = takeover_ = next;
  plan_ = std::move(plan);
  plan_start_ = tick;
}

const Reference& Scheduler::at(int tick) {
  require(started_, "scheduler: reset comes before the first tick");
  require(!asked_ || tick == tick_ + 1, "scheduler: expected tick {}, found {}", tick_ + 1, tick);
  require(plan_.empty() || tick >= plan_start_, "scheduler: expected tick {} or later, found {}", plan_start_, tick);
  asked_ = true;
  tick_ = tick;
  late_ = plan_.empty() || tick - plan_start_ >= options_.late_after_ticks;
  if (late_) {
    ++late_ticks_;
    return last_;  // zero-order hold
  }
  fuse(tick, target_);
  last_.q = target_.q;
  bound_root(target_.X_WB, last_.X_WB);
  return last_;
}

void Scheduler::check_plan(const Reference& reference) const {
  require(started_, "scheduler: reset comes before the first plan");
  check(reference, "plan");
  if (reference.q.size() != last_.q.size())
    throw std::invalid_argument(
        fmt::format("scheduler: plan: expected {} joints, found {}", last_.q.size(), reference.q.size()));
}

// The weight of the new plan, in [0, 1].
double Scheduler::weight(int tick) const {
  return std::min(1.0, static_cast<double>(tick - takeover_) / options_.fuse_ticks);
}

// Algorithm 9. Assigns in place: vectors of the same size do not allocate.
void Scheduler::fuse(int tick, Reference& reference) const {
  const Reference& new_one = entry(plan_, plan_start_, tick);
  const double w = weight(tick);
  if (w >= 1.0) {
    reference = new_one;
    return;
  }
  const Reference& old_one = entry(old_plan_, old_start_, tick);
  reference.X_WB = interpolate(old_one.X_WB, new_one.X_WB, w);
  reference.q = old_one.q + w * (new_one.q - old_one.q);
}

// Moves `emitted` towards `target`, no faster than the bounds; where they do not bind it becomes `target` to the bit.
void Scheduler::bound_root(const Pose& target, Pose& emitted) const {
  const bool tight = tightened_ && weight(tick_) < 1.0;
  const double factor = (tight ? options_.late_factor : 1.0) / kTickRate;
  const Eigen::Vector3d step = target.p - emitted.p;
  const double longest = options_.max_root_speed * factor;
  const double length = step.norm();
  if (length <= longest)
    emitted.p = target.p;
  else
    emitted.p += step * (longest / length);

  const double yaw = yaw_of(emitted.R), target_yaw = yaw_of(target.R);
  const double turn = wrapped(target_yaw - yaw), largest = options_.max_root_yaw_rate * factor;
  if (std::abs(turn) <= largest) {
    emitted.R = target.R;
  } else {  // the tilt follows at once, the heading as far as it may
    const double allowed = yaw + std::copysign(largest, turn);
    emitted.R = (yaw_rotation(allowed - target_yaw) * target.R).normalized();
  }
}

}  // namespace duet
