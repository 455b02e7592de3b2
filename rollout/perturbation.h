// What disturbs an episode beside the clean arm: the controller's view of the state, its way to the joints, pushes, the
// ground, the robot's mass, the policy's view of the partner, the way of its plans, the partner itself. A named value
// of a suite; strict YAML (docs/file-formats.md, "Perturbations").
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/partner_variation.h"
#include "duet/rollout/perception.h"

namespace duet {

inline constexpr const char* kCleanName = "clean";

// Standard deviations of what the controller sees, drawn anew every tick.
struct StateNoise {
  double q = 0.01;        // [rad]
  double v = 0.5;         // [rad/s]
  double w = 0.2;         // of the base, each axis of B [rad/s]
  double gravity = 0.05;  // turn of the base about its x and y, which is what gravity in B shows of it [rad]
};

// A force at a link's centre of mass, level, in a direction drawn for each push. The first begins after every / 2.
struct PushPlan {
  double force = 60.0;    // [N]
  double duration = 1.0;  // [s]
  double every = 4.0;     // from begin to begin [s]
  std::string link;       // "": the card's push_link
};

// Changes of the velocity of the whole robot (Backend::kick), level, each in a direction drawn for it: the first at
// `first`, then one in every `from` to `to`, drawn.
struct KickPlan {
  double speed = 0.5;           // [m/s]
  double first = 2.0;           // [s]
  double from = 3.0, to = 6.0;  // [s]
};

// At the link's centre of mass; the controller keeps the nominal model.
struct AddedMass {
  std::string link;  // "": the card's push_link
  double add = 3.0;  // [kg]; below 0: taken away
};

struct Perturbation {
  std::string name = kCleanName;
  int delay_ticks = 0;      // the controller sees the state of so many ticks ago
  double latency_ms = 0.0;  // from a command to its effect, to the nearest physics step
  std::optional<StateNoise> noise;
  std::optional<PushPlan> push;
  std::optional<KickPlan> kick;
  std::optional<double> friction;  // of the robot and the ground
  std::optional<AddedMass> mass;
  PerceptionPlan perception;
  double plan_latency_ms = 0.0;  // from what a policy saw to its plan in the scheduler, to the nearest tick
  std::optional<PartnerVariation> partner;
};

// The kinds that may be named alone, with their defaults: one table (rollout/perturbation_kinds.h).
const std::vector<std::string>& perturbation_kinds();

// Throws std::invalid_argument for another name, with the nearest; "clean" is one.
Perturbation default_perturbation(const std::string& kind);

// The list under `perturbations` of a suite; [clean] where it is absent. Throws InputError: file, line, expected,
// found.
std::vector<Perturbation> read_perturbations(const YamlSection& suite, const std::string& file);

// One item of that list with every value written out, on one line.
std::string to_yaml(const Perturbation& perturbation);

// The link's index that a perturbation of the robot names; "" names the card's push_link. Throws std::invalid_argument
// with the nearest and all known names.
int perturbed_link(const std::string& name, const RobotModel& robot);

// With the card's push_link where no link is named: what a suite's hash is made of.
Perturbation with_links(Perturbation perturbation, const RobotModel& robot);

// Throws std::invalid_argument where the robot lacks a link that the perturbation names, or would lose all its mass.
void check_perturbation(const Perturbation& perturbation, const RobotModel& robot);

// The robot that is simulated: with the added mass, or `robot` itself.
std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
