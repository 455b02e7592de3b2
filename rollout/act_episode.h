// An episode of a suite: the robot's side of a clip, begun by A.4.4, led by a policy beside a person who acts.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/motion/paired_motion.h"
#include "duet/policies/phase_adaptation.h"
#include "duet/policies/policy.h"
#include "duet/policies/scheduler.h"
#include "duet/rollout/perturbations/partner_perturbation.h"
#include "duet/rollout/reference_source.h"
#include "duet/rollout/rollout.h"

namespace duet {

struct RolloutSetup : EpisodeConditions {
  const PairedMotion* clip = nullptr;
  AdaptedMotion reference;  // the robot's side after A.4.4; frame 0 is tick 0
  std::string
      prompt;  // the policy's language command; empty: the task's own, "... first" where the partner does not begin
  // The partner that the policy sees in the place of the real one; frame 0 is tick 0, the last one stands. Empty:
  // the real one.
  PointTracks seen_partner;
  // The partner's joints where the partner is led (Episode::driven_partner); null: the partner follows the clip.
  std::shared_ptr<const PointTracks> driven_partner;
  std::uint64_t seed = 0;
  bool foot_trace = false;                                    // whether the row is to have one
  int fuse_ticks = kTicksPerPlan;                             // SchedulerOptions
  double max_root_speed = SchedulerOptions{}.max_root_speed;  // [m/s]
};

// Runs until the reference ends (and the partner with it, where it is varied: episode_ticks), or as roll_out of an
// Episode does. A policy that is dead ends it as kError, with its message.
Rollout roll_out(const RolloutSetup& setup, Backend& backend, Controller& controller, Policy& policy);
// The same in any world (rollout/world.h).
Rollout roll_out(const RolloutSetup& setup, World& world, Policy& policy, std::string_view engine);
// The same without physics.
Rollout play_back(const RolloutSetup& setup, Policy& policy);

// The partner's motion from tick 0 on, one frame more than the episode has ticks; and the number of those.
HumanMotion episode_partner(const RolloutSetup& setup);
int episode_ticks(const RolloutSetup& setup);

// The partner of another clip as it would stand to the robot there: moved on the ground and turned about z so that the
// first frame of `theirs` (that clip's reference) comes to lie on the first frame of `ours`. Frame 0 is tick 0.
PointTracks partner_from_elsewhere(const PairedMotion& other, const AdaptedMotion& theirs, const AdaptedMotion& ours);

// A policy at 5 Hz and its scheduler at 50 Hz as the source of an episode's reference: what the policy sees of the
// partner, the time that its plans take, and when they arrive.

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
  const Reference* at(const TickView& present) override;
  [[nodiscard]] std::string message() const override { return policy_.faults().message; }
  // Late plans, faults and times of this episode.
  void finish(Rollout& rollout) const;

 private:
  struct SentPlan {
    int made;  // the tick of what the policy saw
    std::vector<Reference> plan;
  };
  void look(const TickView& present);
  void plan(int tick);
  void deliver(int tick);

  Policy& policy_;
  PolicyReferenceOptions options_;
  int latency_ticks_;
  Perception perception_;
  ObservationHistory history_;
  Scheduler scheduler_;
  Reference corrected_;  // by a policy that corrects
  std::deque<SentPlan> on_their_way_;
  std::vector<double> milliseconds_;
};

}  // namespace duet
