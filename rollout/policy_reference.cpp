#include "duet/rollout/policy_reference.h"

#include <chrono>
#include <cmath>
#include <utility>

#include "duet/core/clock.h"
#include "duet/core/order_statistics.h"

namespace duet {

PolicyReference::PolicyReference(Policy& policy, PolicyReferenceOptions options)
    : policy_(policy),
      options_(std::move(options)),
      latency_ticks_(ticks_of(options_.plan_latency_ms / 1000.0)),
      perception_(options_.perception, options_.perception_seed),
      scheduler_({.fuse_ticks = options_.fuse_ticks, .max_root_speed = options_.max_root_speed}) {}

void PolicyReference::begin(const RobotState& start) {
  options_.context.start = start;
  policy_.reset(options_.context);
  scheduler_.reset({start.X_WB, start.q});
}

const Reference* PolicyReference::at(const Present& present) {
  look(present);
  if (present.tick % kTicksPerPlan == 0) plan(present.tick);
  if (policy_.faults().dead) return nullptr;
  deliver(present.tick);
  return &scheduler_.at(present.tick);
}

void PolicyReference::look(const Present& present) {
  const bool own = options_.seen_partner.empty();
  const HumanJoints partner = own ? *present.partner : partner_joints(options_.seen_partner, present.tick);
  history_.add({perception_.seen(present.tick, partner), present.robot});
}

// No plan is none: the scheduler then holds the last one.
void PolicyReference::plan(int tick) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<Reference> plan = policy_.plan(history_.at(tick));
  milliseconds_.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  if (!plan.empty()) on_their_way_.push_back({tick, std::move(plan)});
}

void PolicyReference::deliver(int tick) {
  while (!on_their_way_.empty() && on_their_way_.front().made + latency_ticks_ <= tick) {
    scheduler_.push(std::move(on_their_way_.front().plan), on_their_way_.front().made);
    on_their_way_.pop_front();
  }
}

void PolicyReference::finish(Rollout& rollout) const {
  rollout.late_plans = scheduler_.late_ticks();
  rollout.policy_faults = policy_.faults();
  rollout.plan_times = {quantile(milliseconds_, 0.5), quantile(milliseconds_, 0.95), quantile(milliseconds_, 1.0)};
}

}  // namespace duet
