// The one closed loop: a robot in an engine follows a reference under a controller, at 50 Hz, until the episode ends.
// The reference comes from a ReferenceSource: a policy with its scheduler, a scripted stream or a recorded motion;
// everything that happens ends in a Recording.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "duet/backends/backend.h"
#include "duet/controllers/controller.h"
#include "duet/core/episode_facts.h"
#include "duet/core/recording.h"
#include "duet/metrics/contact_safety.h"
#include "duet/policies/policy.h"
#include "duet/robots/robot_model.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "duet/rollout/reference_source.h"
#include "duet/rollout/world.h"

namespace duet {

// Ground reaction on the robot: the sum over its contacts. The peak is a mean over a control period, as a rigid
// impact's force in one step is its impulse over the step and says nothing of the robot.
struct GroundForce {
  double mean = 0.0;  // of the vertical component over all physics steps [N]
  double peak = 0.0;  // largest magnitude of the mean over 20 ms [N]
};

// An episode that is taken up again, in an engine, where a recorded one was at a tick. Up to there the source and the
// controller see the recorded states once more and are then as they were; pushes that have begun by then are over.
struct EpisodeRestart {
  std::span<const RobotState> recorded;  // by tick; those before `tick` are used
  int tick = 0;                          // at which physics begins
  RobotState start;                      // there
};

// The conditions of an episode that do not depend on who leads the robot, nor on how long it lasts.
struct EpisodeConditions {
  RobotState start;
  // Its friction, its mass and the partner's size are the scene's too, its view of the partner and its plans are a
  // policy's.
  Perturbation perturbation;
  std::uint64_t perturbation_seed = 0;
  FallRule fall;              // the robot's own, RobotModel::fall
  double wall_limit = 120.0;  // what a ReferenceSource takes is not counted (rollout/world.h) [s]
  EpisodeClock clock = {};
  std::optional<ContactLimits> limits;      // that contacts with a solid partner are held against
  std::function<bool()> stop_asked;         // polled once a tick; the episode then ends as kTimedOut with `interrupted`
  bool partner_yields = false;              // a solid partner gives way (rollout/yielding_partner.h)
  const EpisodeRestart* restart = nullptr;  // outlives the episode; null: physics from the start
};

struct Episode : EpisodeConditions {
  int ticks = 0;        // of 20 ms
  PointTracks partner;  // SMPL joints, frame 0 at tick 0, at least one frame more than ticks; empty: nobody
  // In the place of `partner` where somebody leads the other person too: the ReferenceSource's plan of a tick may
  // change the frames after it (and none before). Null: nobody does.
  std::shared_ptr<const PointTracks> driven_partner;

  [[nodiscard]] const PointTracks& other_person() const { return driven_partner ? *driven_partner : partner; }
};

struct Rollout {
  Recording recording;     // its task and phases are the caller's
  std::string state_hash;  // SHA-256 over the states at 50 Hz
  GroundForce ground;
  std::optional<ContactSafetyResult> safety;  // of a solid partner, at physics rate
  ControllerFaults faults;
  bool interrupted = false;
  // Faults and times of the policy, where one leads (rollout/act_episode.h):
  int late_plans = 0;
  PolicyFaults policy_faults;
  PlanTimes plan_times;
};

// Runs until the ticks are over, the robot falls, the state diverges, the wall limit passes or the source gives no
// reference any more (kError, with its message). Never throws for what the experiment may measure.
Rollout roll_out(const Episode& episode, Backend& backend, Controller& controller, ReferenceSource& source);
// The same in any world, whose name (`engine`) stands in messages. The perturbation's part in engine and controller is
// the world's. Throws what World::begin throws.
Rollout roll_out(const Episode& episode, World& world, ReferenceSource& source, std::string_view engine);
// An episode in which the robot is at each tick where its reference was a tick ago. The perturbation's part in engine
// and controller has no effect.
Rollout play_back(const Episode& episode, ReferenceSource& source);

// A person's joints at a frame (clamped to those that there are) and their velocities towards the next one.
HumanJoints partner_joints(const PointTracks& joints, int frame);
HumanJoints partner_velocities(const PointTracks& joints, int frame, double rate_hz);

}  // namespace duet
