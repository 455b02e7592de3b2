// The steps that the explicit torque law bears under a controller, by its gains on its robot; one sentence
// where an episode's settings are beyond them, and a refusal where a whole suite's are. Found from the mass matrix
// before any episode runs (robots/explicit_step.h).
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

// Feet on the ground make the ankles heavier than in the air, where the bound is found. "Falls at more than twice the
// bound" is right of 152 of the 165 walks under an explicit law in results/published/actuation_walk.
inline constexpr double kShakesBeyond = 2.0;

// Refuses a suite whose own settings, and not a perturbation's, are an explicit law at more than kShakesBeyond times
// the step that a controller of it bears: throws InputError with the joint, the largest step and what would do.
// Controllers whose files are not on this machine are passed over.
void require_bearable_law(const Suite& suite);

}  // namespace duet
