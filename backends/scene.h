// A scene is plain data: one robot on flat ground z = 0, and a human partner made of capsules. The same scene goes to
// every engine.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>

#include "duet/robots/dynamics.h"
#include "duet/robots/human_body.h"
#include "duet/robots/robot_model.h"

namespace duet {

// ghost: the partner touches nothing (as in the supplement). solid: contacts act on the robot and are reported.
enum class PartnerMode { kNone, kGhost, kSolid };

// Friction is stated per pair of bodies (docs/architecture.md, 4); the adapter finds values that give it.
struct PairFriction {
  double robot_ground = 0.8;
  double robot_human = 0.5;
  double robot_robot = 0.5;
};

// Settings of one engine by name (iterations, solver, ...), as its module lists them: EngineModule::options.
using EngineOptions = std::map<std::string, std::string>;

struct Scene {
  std::shared_ptr<const RobotModel> robot;  // shared by all episodes and threads; read-only
  HumanBody human;                          // its capsules carry the skin
  PartnerMode partner = PartnerMode::kGhost;
  PairFriction friction;
  double dt = 0.002;  // physics step [s]
  // In W [m/s^2]. A tilted one is an incline.
  Eigen::Vector3d gravity = {0.0, 0.0, -kGravity};
  bool self_collision = true;  // the pairs of RobotModel::self_collision touch
  EngineOptions options;       // of the engine that it goes to; what is not named has the engine's default
};

}  // namespace duet
