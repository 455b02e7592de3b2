// A scene is plain data: one robot on flat ground z = 0, and a human partner made of capsules. The same scene goes to
// every engine.
#pragma once

#include <memory>
#include <string>

#include "robots/human_body.h"
#include "robots/robot_model.h"

namespace duet {

// ghost: the partner touches nothing (as in the supplement). solid: contacts act on the robot and are reported.
enum class PartnerMode { kNone, kGhost, kSolid };

// Friction is stated per pair of bodies (ARCHITECTURE decision 4); the adapter finds values that give it.
struct PairFriction {
  double robot_ground = 0.8;
  double robot_human = 0.5;
  double robot_robot = 0.5;
};

struct Scene {
  std::shared_ptr<const RobotModel> robot;  // shared by all episodes and threads; read-only
  HumanBody human;
  PartnerMode partner = PartnerMode::kGhost;
  PairFriction friction;
  double dt = 0.002;                 // physics step [s]
  double human_stiffness = 20000.0;  // skin of the solid partner [N/m]
  double human_damping = 200.0;      // [N s/m]
};

}  // namespace duet
