// Bodies that a hand cannot pass: capsules round head and trunk, sized as those of the solid partner
// (robots/human_body.cpp; a test holds the two against each other), and the hand's own.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/tasks/synthesis/figure.h"

namespace duet::synthesis {

struct SolidPart {
  Eigen::Vector3d from, to;  // ends of the axis, in W [m]
  double radius = 0.0;       // [m]
};

// The parts of a figure whose torso is posed.
std::vector<SolidPart> solid_parts(const Body& body, const Figure& figure);
// The hand of a figure whose arm is posed.
SolidPart solid_hand(const Body& body, const Figure& figure, int side);

// How deep two parts are in each other [m], negative: how far apart; and the unit vector that takes the first out.
struct Overlap {
  double depth = 0.0;
  Eigen::Vector3d out = Eigen::Vector3d::UnitZ();
};
Overlap overlap_of(const SolidPart& part, const SolidPart& other);

// Poses the arm like pose_arm, but so that the hand is on or outside of `partner`: the target goes out until it is.
void pose_arm_outside(const Body& body, const ArmPose& arm, int side, const std::vector<SolidPart>& partner,
                      Figure& figure);

}  // namespace duet::synthesis
