// What the explicit torque law bears of a controller: the largest physics steps by its gains on its robot, and one
// sentence where an episode's settings are beyond them. Found from the mass matrix before any episode runs
// (robots/explicit_step.h). Pure functions.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/experiment/suite/suite.h"
#include "duet/robots/explicit_step.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The profile's settings of an engine, or the perturbation's where it names some.
EngineSettings settings_under(const Perturbation& perturbation, EngineSettings settings);

struct ActuationLimits {
  std::string robot;
  ExplicitStep with_armature, bare;  // with the card's armature, and with none
  std::string joint_with_armature, joint_bare;
};

ActuationLimits actuation_limits(const std::shared_ptr<const RobotModel>& robot, const JointGains& gains);

// "5.6 ms (left_ankle_roll_joint) with the card's armature, 0.29 ms (...) without"; "any step" where nothing is held.
std::string to_text(const ActuationLimits& limits);

// A sentence for each arm of the suite (each perturbation, each of the engines' settings) whose explicit law shakes a
// joint of the controller's robot: which, and the largest step at which it would not. None under the implicit law.
std::vector<std::string> actuation_notes(const Suite& suite, const std::string& controller,
                                         const std::shared_ptr<const RobotModel>& robot, const JointGains& gains);

}  // namespace duet
