// When a person's feet stand: found from the joints alone, so that the same frames can be asked of the robot that is
// made of him. Pure.
#pragma once

#include <array>
#include <vector>

#include "duet/motion/human_motion.h"

namespace duet {

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
