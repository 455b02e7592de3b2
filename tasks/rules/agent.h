// The input of detectors: named tracks of a performer and of a partner, and what every detector of hands asks of them.
// Thread-safe.
#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/episode_facts.h"

namespace duet {

inline constexpr double kAdultArm = 0.58;  // median of SBU's, K3HI's and Kinder's people [m]

// Named tracks of one agent, each (3, T) [m], frame W; those that a detector does not need may stay empty.
struct Agent {
  Eigen::Matrix3Xd lhand, rhand, head, root, torso, lshoulder, rshoulder;
  // Length of an arm from shoulder to hand: bounds that would be a person's size are shares of it. [m]
  double arm = kAdultArm;
};

// A track that a detector needs, as messages name it: "performer.lhand".
struct NamedTrack {
  std::string name;
  const Eigen::Matrix3Xd* track;
};
using Tracks = std::vector<NamedTrack>;

void append(Tracks& tracks, const Tracks& more);
// `who` is "performer" or "partner".
Tracks hands_of(const std::string& who, const Agent& agent);
// The tracks that give a direction towards the partner: his root, without one the performer's shoulders.
Tracks direction_to(const Agent& performer, const Agent& partner);

// Distance of two tracks per frame, (T). [m]
Eigen::ArrayXd distances(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b);

// Height of a track above another, (T): the difference of z. [m]
Eigen::ArrayXd heights(const Eigen::Matrix3Xd& track, const Eigen::Matrix3Xd& root);

// The nearest pair of one hand each at every frame; of equal ones the first of LL, LR, RL, RR (performer's first).
struct ClosestHands {
  Eigen::ArrayXd distance;            // (T) [m]
  std::vector<bool> performer_right;  // T entries: the performer's hand of the pair is the right one
  std::vector<bool> partner_right;
};
ClosestHands closest_hands(const Agent& performer, const Agent& partner);

// A detector's verdict on a motion, and the numbers that it asks for by name.

struct DetectorFigure {
  std::string_view name;  // in DetectorResult::values
  std::string_view unit;
  std::string_view meaning;
};

using Thresholds = std::map<std::string, double>;  // "contact", "min_frames", ...

struct DetectorResult : DetectorFacts {
  std::vector<bool> frames;  // evidence mask, T entries
};

// The rule of an act: how the set `act` tells a task from its neighbours where no threshold of its detector can. A rule
// looks at times and shapes (how long hands stay together and what they do meanwhile, where arms are round a trunk), so
// it is as good on recordings of 15 Hz with centimetres of noise: tracks are smoothed first (tasks/rules/evidence.h).
// Numbers were chosen on the recordings of SBU, K3HI and Kinder and on synthetic clips (docs/detectors.md, "The set
// act").

struct RuleThreshold {
  std::string_view name;
  double value;
  std::string_view unit;
  std::string_view meaning;
};

struct ActRule {
  std::span<const RuleThreshold> thresholds;
  std::span<const DetectorFigure> figures;
  // The tracks that it looks at.
  Tracks (*tracks)(const Agent& performer, const Agent& partner);
  // Takes checked input of 50 Hz: those tracks are there, equally long and finite, and every threshold is in the map.
  // The tracks are smoothed (tasks/rules/evidence.h), once for all rules. The margins' smallest has the sign of the
  // verdict, where there is an "overall" that.
  DetectorResult (*detect)(const Agent& performer, const Agent& partner, const Thresholds& tau);
};

namespace rules {

extern const ActRule kHug, kHandshake, kHighFive, kWave, kBend, kFlyKiss, kFistBump;

}  // namespace rules

}  // namespace duet
