// One person of a clip: body, walk, and what trunk, head and arms do when. The renderer turns it into joints.
#pragma once

#include <array>

#include "duet/tasks/synthesis/arms.h"
#include "duet/tasks/synthesis/curves.h"
#include "duet/tasks/synthesis/gait.h"

namespace duet::synthesis {

// A set of the trunk that lets a hand reach a point.
struct Lean {
  double forward = 0.0;  // inclination of the trunk [rad]
  double side = 0.0;     // of the spine to the right [rad]
  double twist = 0.0;    // of the spine to the left [rad]
  double crouch = 0.0;   // of the pelvis below its standing height [m]
  double shift = 0.0;    // of the pelvis forward, feet planted [m]
  double hips = 0.0;     // of the pelvis over the feet to the left, the trunk with it [rad]
};

struct Performer {
  Performer(const Body& a_body, const Placement& start, const Hold& hang)
      : body(a_body), gait(a_body, start), arms{ArmTrack(hang), ArmTrack(hang)} {}

  // Moves every channel of the trunk at once, but for the hips.
  void lean_to(double begin, double end, const Lean& lean);

  Body body;
  Gait gait;
  Placement act;          // where the feet stand during the act
  double reaction = 0.0;  // how much later than A this person begins things [s]
  double arm_swing = 0.7;
  bool meets_skin = false;  // hands stop at the partner's trunk and head
  Channel forward, side, twist, crouch, shift, hips;
  Channel look{1.0};  // 1: at the partner, 0: straight ahead
  Channel nod;        // of the head, forward [rad]
  std::array<ArmTrack, 2> arms;
  std::array<Sway, 12> sway;
};

// Trunk of a standing person at `root`, set by `lean`; pelvis at `height` less the crouch.
TorsoPose standing_torso(const Body& body, const Placement& root, const Lean& lean, double height);

// The smallest lean beyond `from` (and crouch, when leaning is not enough) that brings `target` (of a person who stands
// at the origin facing +x) within `share` of the arm's length from the shoulder. Best effort where nothing does.
Lean lean_to_reach(const Body& body, int side, const Eigen::Vector3d& target, const Lean& from, double share);

// Shoulder of a person who stands at the origin facing +x.
Eigen::Vector3d shoulder_at(const Body& body, int side, const Lean& lean);

}  // namespace duet::synthesis
