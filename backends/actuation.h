// How a robot's joints are driven: the torque law, the share of the card's rotor inertia (armature) that the engine
// gets, and the physics step. An axis of profiles, suites and perturbations, declared once. docs/conformance.md,
// "Actuation". Functions are pure.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/core/field.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The values that `dt` may have, for a sentence.
std::string step_values();

// "" for a step that divides the control period, else step_values().
std::string refused_step(double dt);

// The names of the laws, in the order of TorqueLaw.
const std::vector<std::string>& torque_law_names();

// The robot with that share (0 to 1) of its card's armature; `robot` itself for 1.
std::shared_ptr<const RobotModel> with_armature(std::shared_ptr<const RobotModel> robot, double share);

// The fields of an Owner that has `law`, `armature` and `dt`, plain or optional.
template <typename Owner>
FieldTable<Owner> actuation_fields() {
  Field<Owner> step = field<Owner>({.name = "dt", .meaning = "physics step", .unit = "s"}, &Owner::dt);
  step.values = step_values();
  step.assign = [read = step.assign](Owner& owner, const std::string& text, const FieldRange& range) {
    Owner with_step = owner;
    if (!read(with_step, text, range).empty()) return step_values();
    std::string refused = refused_step(std::optional<double>(with_step.dt).value_or(0.0));
    if (refused.empty()) owner = std::move(with_step);
    return refused;
  };
  return {field<Owner>({.name = "law",
                        .meaning = "how PD becomes torque: `implicit` solves it with the step, `explicit` takes the "
                                   "state at its start and holds the torque",
                        .choices = torque_law_names()},
                       &Owner::law),
          field<Owner>({.name = "armature", .meaning = "share of the card's rotor inertia", .range = {0.0, 1.0}},
                       &Owner::armature),
          step};
}

}  // namespace duet
