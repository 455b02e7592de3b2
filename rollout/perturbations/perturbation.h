// Disturbances of an episode, beside the clean arm: the controller's view of the state, its way to the joints, pushes,
// the ground, the robot's mass, the policy's view of the partner, the way of its plans, the partner itself. A named
// value of a suite; strict YAML (docs/file-formats.md, "Perturbations").
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/episode_tags.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/perturbations/partner_variation.h"
#include "duet/rollout/perturbations/perception.h"
#include "duet/rollout/perturbations/robot_perturbation.h"

namespace duet {

inline constexpr const char* kCleanName = "clean";

struct Perturbation {
  std::string name = kCleanName;
  int delay_ticks = 0;             // the controller sees the state of so many ticks ago
  double latency_ms = 0.0;         // from a command to its effect, to the nearest physics step
  std::optional<double> friction;  // of the robot and the ground
  std::vector<std::shared_ptr<const RobotPerturbation>> robot = {};  // in the order of the table of kinds
  PerceptionPlan perception;
  double plan_latency_ms = 0.0;  // from what a policy saw to its plan in the scheduler, to the nearest tick
  std::optional<PartnerVariation> partner;
  Tags tags = {};  // that the suite gives it; they change nothing of an episode
};

// How large it is, by what it does. None for the clean arm, for several kinds or values, and where the value is
// not 0 in a clean episode (a friction, a scale).
std::optional<PerturbationSize> size_of(const Perturbation& perturbation);

// The tags that rows hold: its own, its kinds and its size. The clean arm has nothing but its own.
Tags tags_of(const Perturbation& perturbation);

// The kinds that may be named alone, with their defaults: one table (rollout/perturbation_kinds.h).
const std::vector<std::string>& perturbation_kinds();

// Throws std::invalid_argument for another name, with the nearest; "clean" is one.
Perturbation default_perturbation(const std::string& kind);

// The list under `perturbations` of a suite; [clean] where it is absent. Throws InputError: file, line, expected,
// found.
std::vector<Perturbation> read_perturbations(const YamlSection& suite, const std::string& file);

// One item of that list with every value written out, on one line.
std::string to_yaml(const Perturbation& perturbation);

// The perturbation with the card's push_link where no link is named: what a suite's hash is made of.
Perturbation with_links(Perturbation perturbation, const RobotModel& robot);

// Throws std::invalid_argument where the robot lacks a link that the perturbation names, or would lose all its mass.
void check_perturbation(const Perturbation& perturbation, const RobotModel& robot);

// The robot that is simulated: with the added mass, or `robot` itself.
std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
