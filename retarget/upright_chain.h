// The robot above its legs, for PAIR on the ground: the base has a place and a heading, a hinge tilts it forward, it
// never leans sideways, and the legs are solved afterwards from where the soles stand (retarget/leg_pose.h). It is an
// ordinary PairChain, so that every solver takes it.
#pragma once

#include "duet/retarget/pair_chain.h"

namespace duet {

// Joint 0 is the tilt about y, within the card's root bounds; the others are the robot's without its legs. Pairs whose
// frame moves with the legs have point -1. Spheres of arms, trunk and head follow as points after the keypoints'.
// Throws std::invalid_argument for a robot whose card names no legs or no soles, and as make_chain does.
struct UprightChain {
  PairChain chain;
  std::vector<int> robot_joint;  // of each joint of the chain: of the robot; -1 for the tilt
};
UprightChain make_upright_chain(const RobotModel& robot, const PairChain& whole);

}  // namespace duet
