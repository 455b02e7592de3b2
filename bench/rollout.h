// One episode in an engine: the data-flow picture of the README as a loop. Policy at 5 Hz, scheduler and controller at
// 50 Hz, physics at the scene's rate; everything that happens ends in a Recording.
#pragma once

#include <chrono>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "backends/backend.h"
#include "bench/perturbation.h"
#include "controllers/controller.h"
#include "core/recording.h"
#include "metrics/contact_safety.h"
#include "motion/paired_motion.h"
#include "policies/phase_adaptation.h"
#include "policies/policy.h"
#include "policies/scheduler.h"

namespace duet {

// Ground reaction on the robot: the sum over its contacts. The peak is a mean over a control period, as a rigid
// impact's force in one step is its impulse over the step and says nothing of the robot.
struct GroundForce {
  double mean = 0.0;  // of the vertical component over all physics steps [N]
  double peak = 0.0;  // largest magnitude of the mean over 20 ms [N]
};

struct RolloutSetup {
  const PairedMotion* clip = nullptr;
  AdaptedMotion reference;  // the robot's side after A.4.4; frame 0 is tick 0
  RobotState start;
  std::string prompt;  // the policy's language command; empty: the task's own
  // What the policy sees of a partner in the place of the real one; frame 0 is tick 0, the last one stands. Empty:
  // none.
  PointTracks seen_partner;
  std::uint64_t seed = 0;
  Perturbation perturbation;  // but its friction, its mass and the partner's size, which are the scene's too
  std::uint64_t perturbation_seed = 0;
  bool foot_trace = false;              // whether the row is to have one
  int fuse_ticks = kTicksPerPlan;       // SchedulerOptions
  double wall_limit = 120.0;            // [s]
  std::optional<ContactLimits> limits;  // that contacts with a solid partner are held against
  std::function<bool()> stop_asked;     // polled once a tick; the episode then ends as kTimedOut with `interrupted`
};

// Wall time of the policy's plans [ms]; NaN where it made none.
struct PlanTimes {
  double p50 = std::numeric_limits<double>::quiet_NaN(), p95 = p50, max = p50;
};

struct Rollout {
  Recording recording;
  std::string state_hash;  // SHA-256 over the states at 50 Hz
  int late_plans = 0;
  PolicyFaults policy_faults;
  PlanTimes plan_times;
  GroundForce ground;
  std::optional<ContactSafetyResult> safety;  // of a solid partner, at physics rate
  ControllerFaults faults;
  bool interrupted = false;
};

// Runs until the reference ends (and the partner with it, where it is varied: episode_ticks), the robot falls (base
// below 0.45 m or tilted past acos 0.7), the state diverges, the wall limit passes (waiting for plans is not counted)
// or the policy is dead (kError, with its message). Never throws for what the experiment may measure.
Rollout roll_out(const RolloutSetup& setup, Backend& backend, Controller& controller, Policy& policy);

// What the partner does from tick 0 on, one frame more than the episode has ticks; and the number of those.
HumanMotion episode_partner(const RolloutSetup& setup);
int episode_ticks(const RolloutSetup& setup);

// The partner's joints at a frame (clamped to the clip) and their velocities towards the next one.
HumanJoints partner_joints(const PointTracks& joints, int frame);
HumanJoints partner_velocities(const PointTracks& joints, int frame, double rate_hz);

bool has_fallen(const RobotState& state);

// The partner of another clip as it would stand to the robot there: moved on the ground and turned about z so that the
// first frame of `theirs` (that clip's reference) comes to lie on the first frame of `ours`. Frame 0 is tick 0.
PointTracks partner_from_elsewhere(const PairedMotion& other, const AdaptedMotion& theirs, const AdaptedMotion& ours);

// Plays a robot motion in the playback backend: a Recording without physics.
Recording play_back(const RobotMotion& motion, const PointTracks& partner, Task task, const Phases& phases,
                    const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
