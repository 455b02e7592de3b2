// Densify and fuse (supplement F, Algorithms 8 and 9): anchors at 5 Hz -> a 36-D reference at 50 Hz.
#pragma once

#include <vector>

#include "policies/policy.h"

namespace duet {

// Algorithm 8: anchors of a call -> 100 references on the 50 Hz grid, i/50 s after the call. Positions and joints
// linear, rotation slerp.
std::vector<Reference> densify(const Anchors& anchors);

struct SchedulerOptions {
  int fuse_ticks = kTicksPerPlan;  // over which a new plan takes over from the old one, weight growing linearly
  double max_root_speed = 1.5;     // bound on the reference's root [m/s]
  double max_root_yaw_rate = 2.0;  // [rad/s]
  double late_factor = 0.3;        // bounds are multiplied by it while a plan is late (F: "temporarily tightened")
};

class Scheduler {
 public:
  // Throws std::invalid_argument for options out of range (fuse_ticks not in 1..90, a bound <= 0, factor not in (0,
  // 1]).
  explicit Scheduler(const SchedulerOptions& options = {});
  void reset(const Reference& start);
  // A plan made at `tick` of the episode's clock.
  void push(const Anchors& anchors, int tick);
  // The fused reference at `tick`; ticks come in order, each once. With no plan for this tick (late): holds the last
  // one and tightens the root bounds. The reference stays valid until the next call.
  const Reference& at(int tick);
  [[nodiscard]] bool late() const { return late_; }  // at the last tick asked for: the plan is older than its period
  [[nodiscard]] int late_ticks() const { return late_ticks_; }

 private:
  SchedulerOptions options_;
  std::vector<Reference> old_plan_, plan_;
  int old_start_ = 0, plan_start_ = 0;
  Reference last_;
  bool started_ = false, late_ = false;
  int late_ticks_ = 0;
};

}  // namespace duet
