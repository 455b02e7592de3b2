// A policy at 5 Hz and its scheduler at 50 Hz as the source of an episode's reference: what the policy sees of the
// partner, the time that its plans take, and when they arrive.
#pragma once

#include <deque>
#include <vector>

#include "duet/policies/observation_history.h"
#include "duet/policies/policy.h"
#include "duet/policies/scheduler.h"
#include "duet/rollout/perturbations/perception.h"
#include "duet/rollout/reference_source.h"
#include "duet/rollout/rollout.h"

namespace duet {

struct PolicyReferenceOptions {
  EpisodeContext context;         // but its start, which the episode gives
  PointTracks seen_partner = {};  // in the place of the real one; frame 0 is tick 0, the last one stands. Empty: none
  PerceptionPlan perception = {};
  std::uint64_t perception_seed = 0;
  double plan_latency_ms = 0.0;  // from what a policy saw to its plan in the scheduler, to the nearest tick
  int fuse_ticks = kTicksPerPlan;
  double max_root_speed = SchedulerOptions{}.max_root_speed;  // [m/s]
};

class PolicyReference final : public ReferenceSource {
 public:
  // Throws what Scheduler throws. Refers to the policy.
  PolicyReference(Policy& policy, PolicyReferenceOptions options);

  void begin(const RobotState& start) override;
  const Reference* at(const Present& present) override;
  [[nodiscard]] std::string message() const override { return policy_.faults().message; }
  // Late plans, faults and times of this episode.
  void finish(Rollout& rollout) const;

 private:
  struct SentPlan {
    int made;  // the tick of what the policy saw
    std::vector<Reference> plan;
  };
  void look(const Present& present);
  void plan(int tick);
  void deliver(int tick);

  Policy& policy_;
  PolicyReferenceOptions options_;
  int latency_ticks_;
  Perception perception_;
  ObservationHistory history_;
  Scheduler scheduler_;
  std::deque<SentPlan> on_their_way_;
  std::vector<double> milliseconds_;
};

}  // namespace duet
