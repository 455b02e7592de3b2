// The six detectors behind detect_performer (metrics/detector.h), one source file each. They take checked input: the
// tracks that the task needs are there, equally long and finite, and every threshold of the task is in the map.
// What the printed algorithms leave open is said at each and in docs/deviations.md.
#pragma once

#include "metrics/detector.h"

namespace duet {

// Algorithm 1. Parts double_embrace, single_embrace, shoulder_embrace. Evidence: frames at which one of them holds.
// Margins of hand_dist, body and shoulder are of their own mode; "overall" is the best mode's and decides.
DetectorResult detect_hug(const Agent& performer, const Agent& partner, const Thresholds& tau,
                          const DetectorReadings& readings);

// Algorithm 2. Parts contact_phase, stability_phase. Evidence: contact frames at a valid distance.
DetectorResult detect_handshake(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings& readings);

// Algorithm 3. Parts approach, not_sustained. Evidence: close frames at a valid height.
DetectorResult detect_high_five(const Agent& performer, const Agent& partner, const Thresholds& tau,
                                const DetectorReadings& readings);

// Algorithm 4. Parts motion_sufficient, direction_changes, amplitude_check, height_check. Evidence: frames at which a
// counted change of direction happens.
DetectorResult detect_wave(const Agent& performer, const Agent& partner, const Thresholds& tau,
                           const DetectorReadings& readings);

// Algorithm 5. Parts angle_condition, stability_condition. Evidence: frames bent far enough.
DetectorResult detect_bend(const Agent& performer, const Agent& partner, const Thresholds& tau,
                           const DetectorReadings& readings);

// Algorithm 6. Parts condition_A, condition_B. Evidence: frames with the hand at the head or arrived at by a forward
// step.
DetectorResult detect_fly_kiss(const Agent& performer, const Agent& partner, const Thresholds& tau,
                               const DetectorReadings& readings);

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
