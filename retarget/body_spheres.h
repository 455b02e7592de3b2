// Spheres along the robot's arms, trunk, head and thighs and along the partner's body, and which of them must not lie
// in each other: what PAIR's penetration term sees of the two bodies.
#pragma once

#include <vector>

#include "duet/core/point_tracks.h"
#include "duet/motion/human_motion.h"
#include "duet/retarget/upright_chain.h"

namespace duet {

// Two spheres by index: the robot's first, then the partner's.
struct SpherePair {
  int a = 0, b = 0;
  double reach = 0.0;  // sum of the radii [m]
};

struct BodySpheres {
  std::vector<int> robot_point;   // per sphere of the robot: its point of the chain
  PointTracks human;              // (T, H, 3): the partner's before optimisation
  std::vector<int> human_offset;  // per sphere of the partner: which of the 6 offsets moves it, -1 for none
  std::vector<SpherePair> pairs;
};

// Adds the robot's spheres to the points of `chain`. Pairs within the robot are those of regions that its card lets
// touch; pairs of the two bodies leave out hands against hands and arms, which are meant to meet, and thighs against
// what is above the hips.
BodySpheres make_body_spheres(const RobotModel& robot, UprightChain& chain, const HumanMotion& partner);

}  // namespace duet
