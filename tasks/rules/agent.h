// The input of detectors: named tracks of a performer and of a partner, and what every detector of hands asks of them.
// Thread-safe.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

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

}  // namespace duet
