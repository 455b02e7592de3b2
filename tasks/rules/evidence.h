// The input of the rules of acts: smoothed tracks, spans of frames, and the times at which a hand of one stays with a
// hand of the other. 50 Hz. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/tasks/rules/agent.h"

namespace duet {

// Runs and windows over frames, as the detectors need them: how long a condition holds, and by how much a threshold
// could move before the verdict turns. Per-frame figures are (T), one entry per frame. Thread-safe.

using FrameMask = std::vector<bool>;

// MaxConsecutiveFrames of Algorithms 1 to 6.
int longest_run(const FrameMask& mask);
int count_frames(const FrameMask& mask);
FrameMask both(const FrameMask& a, const FrameMask& b);
FrameMask either(const FrameMask& a, const FrameMask& b);
// Entries of `values` below, at or below, ... a threshold.
FrameMask below(const Eigen::ArrayXd& values, double threshold);     // <
FrameMask at_most(const Eigen::ArrayXd& values, double threshold);   // <=
FrameMask above(const Eigen::ArrayXd& values, double threshold);     // >
FrameMask at_least(const Eigen::ArrayXd& values, double threshold);  // >=

// Frames that a threshold counted in frames asks for: the next whole number, at least 1.
int frames_needed(double threshold);

// Slack of a threshold, positive where it is satisfied. `allowed` are the frames at which the detector's other
// conditions hold; where they leave no k frames to look at, they are ignored, so that a failure is blamed on the
// threshold that causes it. -infinity with fewer than k frames.
//
// For "k consecutive frames below (above) the threshold": the threshold minus the smallest maximum over windows of k
// frames (the largest minimum minus the threshold).
double run_slack_below(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed);
double run_slack_above(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed);
// For "k frames below (above) the threshold" anywhere: with the k-th smallest (largest) value.
double count_slack_below(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed);
double count_slack_above(double threshold, const Eigen::ArrayXd& values, int k, const FrameMask& allowed);

}  // namespace duet

namespace duet::rules {

inline constexpr double kRateHz = 50.0;
inline constexpr int kSmoothing = 7;  // frames: about the 0.13 s that a lost frame of 15 Hz spoils

// Centred moving mean over `window` frames (odd), fewer at either end.
Eigen::Matrix3Xd smoothed(const Eigen::Matrix3Xd& track, int window = kSmoothing);
Agent smoothed(const Agent& agent);  // each track that is there

// Frames [begin, end).
struct FrameSpan {
  int begin = 0, end = 0;
  [[nodiscard]] int frames() const { return end - begin; }
  [[nodiscard]] double seconds() const { return frames() / kRateHz; }
};
std::vector<FrameSpan> spans_of(const FrameMask& mask);
FrameMask mask_of(const FrameSpan& span, Eigen::Index frames);

// Level unit vector from one place to another; zero where none is level of the other.
Eigen::Vector2d level_direction(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

// Where the mouth is: before the head, towards the partner, and below its middle; both a share of the arm. (3, T) [m]
Eigen::Matrix3Xd mouth_of(const Agent& performer, const Agent& partner);

// Mean height of both shoulders, (T). [m]
Eigen::ArrayXd shoulder_heights(const Agent& agent);

// A place at which a motion turns back.
struct TurningPoint {
  int frame = 0;
  double place = 0.0;
};
// Where `place`, (T), turns back by `least` or more, in order of time; its ends are none.
std::vector<TurningPoint> turning_points(const Eigen::ArrayXd& place, double least);

// Least turn of clasped hands that counts: in SBU and K3HI hands that only meet turn less often than three times. [m]
inline constexpr double kShakeTurn = 0.015;

// How near hands are while they are together: nearer than `contact`, or, where they never come so near (short hands of
// a skeleton), within `steady` of their least distance, which is below `farthest`. [m]
struct Nearness {
  double contact = 0.2, steady = 0.06, farthest = 0.3;
};

// A time at which one hand of the performer and one of the partner are together.
struct HandMeeting {
  FrameSpan span;
  bool performer_right = false, partner_right = false;
  double nearest = 0.0;  // least distance of the two [m]
  int turns = 0;         // times that both hands turn up or down by kShakeTurn or more, the lesser
  double shake = 0.0;    // range of heights that both hands go through, the lesser, but for 0.04 s at either end [m]
  double travel = 0.0;   // the larger [m]
  double own_height = 0.0, other_height = 0.0;  // of each hand over its own shoulders, mean [m]
  double trunks = 0.0;                          // horizontal distance of the two trunks, mean [m]
  double closing = 0.0;                         // by which the hands came nearer in the 0.2 s before, at most [m/s]
  double parted = 0.0;  // farthest that the two are apart afterwards; where nothing follows: at its end [m]
};

// The meetings in smoothed tracks (hands, torso, shoulders of both), in the order LL, LR, RL, RR and of time.
std::vector<HandMeeting> hand_meetings(const Agent& performer, const Agent& partner, const Nearness& near);

// Hands, torso and shoulders of both.
Tracks meeting_tracks(const Agent& performer, const Agent& partner);

// Horizontal distance of the two trunks, (T). [m]
Eigen::ArrayXd trunk_distances(const Agent& performer, const Agent& partner);

}  // namespace duet::rules
