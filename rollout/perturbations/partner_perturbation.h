// Perturbations of the partner: how the person moves, and how the policy sees the person.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/task.h"
#include "duet/motion/human_motion.h"
#include "duet/policies/policy.h"

namespace duet {

// A partner who moves otherwise than the clip: of another size, faster, later, hesitating, turning back, walking up,
// moving on, with the other hand. Physics, policy, detectors and recording all have this partner; the robot's reference
// stays that of the clip.

struct PartnerVariation {
  double scale = 1.0;  // of the body about the place on the ground below its root; the way it walks stays
  double speed = 1.0;  // of its motion, from the episode's start on
  // Above 0: waits so long before it starts. Below 0: starts so far into its preparation, at most at the act. [s]
  double shift_s = 0.0;
  double hesitate_s = 0.0;  // stands still so long at half of its preparation [s]
  bool abort = false;       // at the middle of the act it goes back the way it came, as fast, and stays where it began
  // Ways on the ground, the body as in the clip, in the axes of its heading in the first frame of the act, in which it
  // faces the other person. Absent: none, and not written, as in suites of before.
  std::optional<double> comes_m = {};     // begins so far behind its place and is there after half of its preparation
  std::optional<double> moves_on_m = {};  // over the second half of it goes so far back, and stays there
  std::optional<double> aside_m = {};     // and so far to its left
  std::optional<bool> other_hand = {};    // every pose is the mirror image of the clip's, about its own middle plane
};

// Ticks of an episode whose reference has so many (50 Hz): as many more as the partner needs to do at least what it
// does in the clip by then (shift, hesitation, a speed below 1).
int episode_ticks(const PartnerVariation& variation, int reference_ticks);

// The partner's motion from tick 0 on, `frames` frames of it, never past the clip's end. Frame 0 of the episode is
// `clip_frame` of the clip, `phases` are the episode's. Without a variation the clip's own frames to the bit, the last
// one repeated.
HumanMotion partner_motion(const HumanMotion& clip, const std::optional<PartnerVariation>& variation,
                           const Phases& phases, int clip_frame, int frames);

// Disturbances of a policy's view of its partner: noise, dropouts, latency, and faults of a tracker. They change
// ObservationFrame::partner alone; physics, detectors and recording have the real partner.

// The partner is seen as at `at` for so long.
struct PerceptionFreeze {
  double at = 2.0, duration = 1.0;  // [s]
};

// From `at` on every joint is seen so far from its place, level, in a direction drawn for the episode.
struct PerceptionJump {
  double at = 2.0, metres = 0.3;
};

struct PerceptionPlan {
  double jitter = 0.0;           // standard deviation on each axis of each joint, drawn anew every tick [m]
  double dropout = 0.0;          // probability per joint and tick; such a joint keeps its last seen place
  double latency_ms = 0.0;       // the partner is seen as so long ago, to the nearest tick; at first as at the start
  std::optional<double> vanish;  // from then on the partner is not seen: the last seen pose stays [s]
  std::optional<PerceptionFreeze> freeze;
  std::optional<PerceptionJump> jump;
};

// A plan at work in one episode. Nothing allocates after construction; not thread-safe.
class Perception {
 public:
  using Joints = Eigen::Matrix<double, 3, kSmplJoints>;

  // The seed's streams are its own: other perturbations of the episode draw the same with and without it.
  Perception(const PerceptionPlan& plan, std::uint64_t seed);
  // The partner as it is seen at this tick (50 Hz); once per tick, ticks from 0 in order.
  const Joints& seen(int tick, const Joints& partner);

 private:
  [[nodiscard]] bool held(int tick) const;
  const Joints& delayed(const Joints& partner);
  void measure(int tick, const Joints& partner);

  PerceptionPlan plan_;
  Random jitter_, dropout_;
  Eigen::Vector3d jump_ = Eigen::Vector3d::Zero();
  std::vector<Joints> past_;  // a ring as long as the latency, the current one included
  std::size_t newest_ = 0;
  Joints seen_;
};

}  // namespace duet
