// Two people as a depth camera would have recorded them: 15 joints at a low rate with noise, arms that are lost where
// the bodies hide them, read back by the importer of such files (motion/people/). The motion itself stays what it was:
// a policy is scored on that; noise on what a policy sees is a suite's perturbation (`duet list perturbations`).
#pragma once

#include <cstdint>

#include "duet/motion/interaction_clip.h"

namespace duet {

// Defaults as found on SBU (docs/synthesis.md).
struct TrackerModel {
  double rate_hz = 15.0;
  double noise = 0.0015;      // standard deviation of a joint, each axis and frame for itself [m]
  double crowded = 2.5;       // times as much where the two are nearer than kCrowded
  double drift = 0.004;       // and of a slow error of each joint [m]
  double drift_time = 0.8;    // over which it changes [s]
  double limb_noise = 0.011;  // of elbows, hands, knees and feet besides [m]
  // For as long as it looks it has feet aside of where they are, by such a standard deviation along each level axis,
  // half of it in the knees; and the neck, and the shoulders, so much lower than a body model has them. [m]
  double feet = 0.19;
  double low_neck = 0.12, low_shoulders = 0.06;
  double high_head = 0.0;  // and the head so much higher: its middle, where a body model has its lower end [m]
  // Shares of the way to the other shoulder, to the other hip and from elbow to hand by which it has a joint there.
  double narrow_shoulders = 0.0, narrow_hips = 0.0, low_elbows = 0.0;
  // A hand within this of the other person is lost at times, and jumps. [m]
  double hidden_within = 0.30;
  double lost_share = 0.16;  // of such frames
  double lost_noise = 0.06;  // standard deviation of elbow and hand then [m]
};

// The tracker that saw a synthetic clip: that of SBU, or drawn from wider ranges for one that varies.
TrackerModel tracker_of(const InteractionClip& clip, std::uint64_t seed);

inline constexpr double kCrowded = 0.8;  // between the roots, level [m]

// Phases, contacts, task, reactor and provenance are the clip's own; the id has "-tracked" at its end. At the clip's
// rate. Throws std::invalid_argument for a rate outside 5 to 120 Hz or a negative figure.
InteractionClip add_tracker_noise(const InteractionClip& clip, const TrackerModel& tracker, std::uint64_t seed);

}  // namespace duet
