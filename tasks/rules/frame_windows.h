// Runs and windows over frames, as the detectors need them: how long a condition holds, and by how much a threshold
// could move before the verdict turns. Per-frame figures are (T), one entry per frame. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace duet {

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
