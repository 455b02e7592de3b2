#include "duet/experiment/plan/actuation_limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "duet/backends/actuation.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/require.h"
#include "duet/rows/episode_row.h"

namespace duet {
namespace {

ExplicitStep step_with(const std::shared_ptr<const RobotModel>& robot, const JointGains& gains, double armature) {
  const std::shared_ptr<const RobotModel> driven = with_armature(robot, armature);
  return largest_explicit_step(*driven, driven->standing_state(), gains);
}

std::string joint_of(const RobotModel& robot, const ExplicitStep& step) {
  return step.joint < 0 ? "" : robot.joints[step.joint].name;
}

std::string step_text(const ExplicitStep& step, const std::string& joint) {
  return std::isfinite(step.largest) ? fmt::format("{:.2g} ms ({})", 1e3 * step.largest, joint) : "any step";
}

std::string armature_text(double share) {
  if (share == 0.0) return "without armature";
  return share == 1.0 ? "with the card's armature" : fmt::format("with {:g} of the card's armature", share);
}

}  // namespace

EngineSettings settings_under(const Perturbation& perturbation, EngineSettings settings) {
  if (!perturbation.actuation) return settings;
  settings.law = perturbation.actuation->law.value_or(settings.law);
  settings.armature = perturbation.actuation->armature.value_or(settings.armature);
  settings.dt = perturbation.actuation->dt.value_or(settings.dt);
  return settings;
}

ActuationLimits actuation_limits(const std::shared_ptr<const RobotModel>& robot, const JointGains& gains) {
  ActuationLimits limits{.robot = robot->name,
                         .with_armature = step_with(robot, gains, 1.0),
                         .bare = step_with(robot, gains, 0.0),
                         .joint_with_armature = "",
                         .joint_bare = ""};
  limits.joint_with_armature = joint_of(*robot, limits.with_armature);
  limits.joint_bare = joint_of(*robot, limits.bare);
  return limits;
}

std::string to_text(const ActuationLimits& limits) {
  return fmt::format("{} with the card's armature, {} without",
                     step_text(limits.with_armature, limits.joint_with_armature),
                     step_text(limits.bare, limits.joint_bare));
}

std::vector<std::string> actuation_notes(const Suite& suite, const std::string& controller,
                                         const std::shared_ptr<const RobotModel>& robot, const JointGains& gains) {
  std::vector<std::string> notes;
  std::map<double, ExplicitStep> steps;  // by armature
  for (const Perturbation& perturbation : suite.perturbations)
    for (const std::string& engine : suite.engines) {
      if (engine == kPlaybackEngine) continue;
      const EngineSettings settings = settings_under(perturbation, suite.profile.settings(engine));
      if (settings.law != TorqueLaw::kExplicit) continue;
      if (!steps.contains(settings.armature)) steps[settings.armature] = step_with(robot, gains, settings.armature);
      const ExplicitStep& step = steps[settings.armature];
      if (settings.dt <= step.largest) continue;
      std::string note = fmt::format(
          "controller '{}', arm '{}': the explicit law at {:g} ms {} shakes {} of {} whatever the policy does; below "
          "{:.2g} ms it would not",
          controller, perturbation.name, 1e3 * settings.dt, armature_text(settings.armature), joint_of(*robot, step),
          robot->name, 1e3 * step.largest);
      if (std::ranges::find(notes, note) == notes.end()) notes.push_back(std::move(note));
    }
  return notes;
}

void require_bearable_law(const Suite& suite) {
  std::vector<std::pair<std::string, EngineSettings>> driven;  // engines under an explicit law
  for (const std::string& engine : suite.engines)
    if (engine != kPlaybackEngine && suite.profile.settings(engine).law == TorqueLaw::kExplicit)
      driven.emplace_back(engine, suite.profile.settings(engine));
  if (driven.empty()) return;
  for (const SuiteController& controller : suite.controllers) {
    std::shared_ptr<const RobotModel> robot;
    JointGains gains;
    try {
      robot = load_shared_robot(suite.card_of(controller));
      gains = standing_gains(*make_controller(controller.use, robot, controller.options), *robot);
    } catch (const MissingError&) {
      continue;
    }
    for (const auto& [engine, settings] : driven) {
      const ExplicitStep step = step_with(robot, gains, settings.armature);
      if (settings.dt <= kShakesBeyond * step.largest) continue;
      throw InputError(fmt::format(
          "suite '{0}': law of engine '{1}': expected a step of at most {2:.2g} ms for the explicit law {3} under "
          "controller '{4}', found {5:g} ms, at which {6} of {7} shakes whatever the policy does; give the controller "
          "the option explicit_step: {8:g}, or, to measure what it costs, write it as a perturbation `actuation`",
          suite.name, engine, 1e3 * step.largest, armature_text(settings.armature), controller.name, 1e3 * settings.dt,
          joint_of(*robot, step), robot->name, settings.dt));
    }
  }
}

}  // namespace duet
