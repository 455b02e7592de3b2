// Fuses plans (supplement F, Algorithm 9): anchors at 5 Hz -> a 36-D reference at 50 Hz.
#pragma once

#include <vector>

#include "duet/policies/policy.h"

namespace duet {

inline constexpr int kMostFuseTicks = 90;  // inside the 100 ticks of a plan, with room for a plan that comes late

struct SchedulerOptions {
  int fuse_ticks = kTicksPerPlan;  // over which a new plan takes over from the old one, weight growing linearly
  double max_root_speed = 1.5;     // bound on the reference's root [m/s]
  double max_root_yaw_rate = 2.0;  // [rad/s]
  double late_factor = 0.3;        // bounds are multiplied by it while a plan is late (F: "temporarily tightened")
                                   // and until the next one has taken over
  int late_after_ticks = kTicksPerPlan;  // a plan of that age is late
};

// One owner, not thread-safe. at() allocates nothing.
class Scheduler {
 public:
  // Throws std::invalid_argument for options out of range (fuse_ticks or late_after_ticks not in 1..90, a bound <= 0,
  // factor not in (0, 1]).
  explicit Scheduler(const SchedulerOptions& options = {});
  // Clears every plan; `start` is held until the first one takes over. Throws std::invalid_argument where it is not
  // finite or its quaternion not unit (to 1e-6).
  void reset(const Reference& start);
  // A plan made at `tick` of the episode's clock. It may arrive later than that (latency): it takes over, with a weight
  // growing from 0, from the next tick that is asked for. Throws std::invalid_argument before reset, for anchors as
  // refused by reset or with another number of joints, for a tick that is not after the previous plan's or is after the
  // next one to be asked for.
  void push(const Anchors& anchors, int tick);
  // A plan of one reference per tick (Policy::plan); what follows its last one is that one. Refused too: no reference.
  void push(std::vector<Reference> plan, int tick);
  // The fused reference at `tick`; ticks come in order, each once (std::invalid_argument otherwise). With no plan for
  // this tick (late): holds the last one and tightens the root bounds. The reference stays valid until the next call.
  const Reference& at(int tick);
  [[nodiscard]] bool late() const { return late_; }  // at the last tick asked for: the plan is older than its period
  [[nodiscard]] int late_ticks() const { return late_ticks_; }

 private:
  void check_plan(const Reference& reference) const;
  [[nodiscard]] double weight(int tick) const;
  void fuse(int tick, Reference& reference) const;
  void bound_root(const Pose& target, Pose& emitted) const;

  SchedulerOptions options_;
  std::vector<Reference> old_plan_, plan_;  // on the 50 Hz grid; old_plan_ is what was fused before `plan_` came
  int old_start_ = 0, plan_start_ = 0;      // ticks of their first entries
  int takeover_ = 0;                        // first tick at which plan_ counts
  Reference last_, target_;                 // emitted; asked for before the root's bounds
  bool started_ = false, asked_ = false, late_ = false, tightened_ = false;
  int tick_ = 0;  // last one asked for
  int late_ticks_ = 0;
};

}  // namespace duet
