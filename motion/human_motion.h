// One person's motion: SMPL-24 joint positions at a fixed rate, with global joint rotations where the source has them.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

#include "duet/core/recording.h"

namespace duet {

struct HumanMotion {
  double rate_hz = 50.0;
  PointTracks joints;  // (T, 24, 3) [m], frame W, z up
  // R_WJ, T * 24 entries in (T, 24) order, unit; empty where unknown. J is turned with the body segment at the joint
  // and has the axes of W while the person stands in the reference posture (T pose, facing +x).
  std::vector<Eigen::Quaterniond> rotations;

  [[nodiscard]] int frames() const { return joints.frames(); }
};

// Throws std::invalid_argument naming `what`, the place (frame, joint) and what is wrong: not 24 joints, fewer than two
// frames, a value that is not finite, a rotation that is not unit (1e-6) or their number, a bone shorter than 1 mm.
void validate(const HumanMotion& motion, const std::string& what);

// Length of the bone from each joint to its parent, mean over frames; entry 0 is 0. [m]
std::array<double, kSmplJoints> bone_lengths(const HumanMotion& motion);

// Heading of the person at a frame: the horizontal direction at right angles to the line of hips and shoulders, rotated
// to point forward. [rad] about z, 0 = x axis. Throws std::invalid_argument where hips and shoulders are all vertical.
double heading(const PointTracks& joints, int frame);

// Resamples to `rate_hz`, first and last instants kept (the last is the last multiple of the new period inside the
// motion). Positions linear, rotations slerp; never skips frames. Throws std::invalid_argument for a rate that is not
// positive.
HumanMotion resample(const HumanMotion& motion, double rate_hz);

// How many frames resample gives for `frames` at `rate_hz` (both positive).
int resampled_frames(int frames, double rate_hz, double new_rate_hz);

// Where an instant lies between the frames of a motion; `index` counts its frames.
struct FrameBetween {
  int frame = 0;      // at or before
  double part = 0.0;  // of the way to the next frame, [0, 1); 0 where the instant is a frame's (to 1e-9 of a period)
};
FrameBetween frame_between(double index, int frames);

// Frames [begin, end).
HumanMotion slice(const HumanMotion& motion, int begin, int end);

// The two people of a clip.
enum class Person { kA, kB };

// When a person's feet stand: found from the joints alone, so that the same frames can be asked of the robot that is
// made of him. Pure.

// Per foot, left before right: whether it stands in a frame. It stands where it stays in one place, low, for long
// enough; where the place moves on, there is a step between two stances.
struct FootStance {
  std::array<std::vector<char>, 2> stands;

  [[nodiscard]] bool both(int frame) const { return stands[0][frame] != 0 && stands[1][frame] != 0; }
};

// Thresholds of docs/retargeting.md, found on recorded and synthetic people: they pass over the centimetres by which a
// depth camera's feet jump and see a step of 15 cm.
struct StanceRule {
  double smoothing = 0.08;  // standard deviation of the Gaussian that the path is smoothed with [s]
  double window = 0.4;      // in which a foot that stands stays within `place` [s]
  double place = 0.06;      // from the middle of the window, horizontally [m]
  double drift = 0.12;      // from the middle of a stance, at most: then it has stepped [m]
  double step = 0.24;       // that a step takes at least [s]
  double height = 0.08;     // over the foot's 10th percentile of height, at most [m]
};

FootStance find_stance(const HumanMotion& motion, const StanceRule& rule = {});

// Moving average with a Gaussian of `sigma` samples, ends repeated; sigma 0 returns x. A column is a sample.
Eigen::MatrixXd smoothed(const Eigen::MatrixXd& x, double sigma);

}  // namespace duet
