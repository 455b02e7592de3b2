// A kind of perturbation: how it is read, written, listed and documented. Made of a table of fields (core/field.h) by
// one of four forms below.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "duet/robots/yaml_schema.h"
#include "duet/rollout/perturbations/perturbation.h"

namespace duet {

// A value of a kind that is 0 in a clean episode, with its unit in tables and how many of them its own unit is.
struct PerturbationAxis {
  std::string field, unit;
  double factor = 1.0;
};

using FieldTexts = std::vector<std::pair<std::string, std::string>>;  // name and text, as flow_mapping has them

template <typename Owner>
FieldTexts field_texts(const FieldTable<Owner>& table, const Owner& owner) {
  FieldTexts texts;
  for (const Field<Owner>& known : table)
    if (std::string text = known.text(owner); !text.empty()) texts.emplace_back(known.name, std::move(text));
  return texts;
}

// A key of a perturbation's mapping. Its rows are of the mapping below it; of a kind that is one value, that value.
struct PerturbationKind : SchemaKey<Perturbation> {
  PerturbationKind(const std::string& kind, std::string about, Read reader, std::vector<FieldRow> described,
                   Write writer)
      : SchemaKey<Perturbation>(kind, std::move(reader), std::move(described), std::move(writer)),
        meaning(std::move(about)) {}

  std::string meaning;
  std::string fallback = "{}";                                    // what the name alone stands for
  std::function<FieldTexts(const Perturbation& of)> values = {};  // of its mapping, where there is some of it
  std::vector<PerturbationAxis> axes = {};                        // none: no value of it is a size
};

inline constexpr FieldRange kEpisodeTime = {0.0, 600.0};  // [s]

// A kind of one value, under a key of its mapping: what the perturbation has of it where it is not clean, `fallback`
// where the mapping is empty.
PerturbationKind valued_kind(const std::string& name, std::string meaning, const Field<Perturbation>& value,
                             const std::string& fallback);
// A kind that is a value itself, without a mapping.
PerturbationKind plain_kind(const Field<Perturbation>& value, const std::string& fallback);

// Reads a plan from its mapping: an empty one, the name alone, gives Plan(); values that another leaves out are
// `named`'s.
template <typename Plan>
Plan read_plan(const SchemaSection& item, const std::string& name, const FieldTable<Plan>& table, const Plan& named) {
  const YamlSection mapping(item.file, item.node(name.c_str()), name, key_names(table));
  Plan plan = mapping.keys().size() > 0 ? named : Plan();
  read_fields(mapping, table, plan);
  return plan;
}

// A kind whose values are a struct of its own: `found` gives that of a perturbation, null where it has none, and `put`
// gives it one.
template <typename Plan, typename Found, typename Put>
PerturbationKind plan_kind(const std::string& name, std::string meaning, const FieldTable<Plan>& table, Found found,
                           Put put, const Plan& named) {
  const auto read = [=](const SchemaSection& item, Perturbation& into) {
    put(into, read_plan(item, name, table, named));
  };
  const auto write = [=](const Perturbation& of) { return found(of) ? flow_mapping(table, *found(of)) : ""; };
  PerturbationKind kind(name, std::move(meaning), read, field_rows(table, Plan()), write);
  kind.values = [=](const Perturbation& of) { return found(of) ? field_texts(table, *found(of)) : FieldTexts(); };
  return kind;
}

// `slot` is the optional one of a perturbation.
template <typename Plan, typename Slot>
PerturbationKind planned_kind(const std::string& name, std::string meaning, const FieldTable<Plan>& table, Slot slot,
                              const Plan& named = {}) {
  return plan_kind(
      name, std::move(meaning), table, [slot](const Perturbation& of) { return slot(of) ? &*slot(of) : nullptr; },
      [slot](Perturbation& into, Plan plan) { slot(into) = std::move(plan); }, named);
}

// The values of a kind that acts on the robot; null where the perturbation has none of it.
template <typename Plan>
const Plan* robot_plan(const Perturbation& of) {
  for (const std::shared_ptr<const RobotPerturbation>& one : of.robot)
    if (const auto* plan = dynamic_cast<const Plan*>(one.get())) return plan;
  return nullptr;
}

// A kind that acts on the robot: `Plan` is a RobotPerturbation.
template <typename Plan>
PerturbationKind robot_kind(const std::string& name, std::string meaning, const FieldTable<Plan>& table,
                            const Plan& named = {}) {
  return plan_kind(
      name, std::move(meaning), table, robot_plan<Plan>,
      [](Perturbation& into, Plan plan) { into.robot.push_back(std::make_shared<const Plan>(std::move(plan))); },
      named);
}

// The kinds of perturbation: one table, from which they are read, written, hashed, listed and documented. A new kind
// that acts on the robot is a unit in rollout/kinds and a row here.
const std::vector<PerturbationKind>& perturbation_kind_table();

// Sudden changes of the robot's velocity.
PerturbationKind kick_kind();

// Mass that the controller does not know.
PerturbationKind mass_kind();

// Noise of what the controller measures.
PerturbationKind noise_kind();

// Pushes at a link.
PerturbationKind push_kind();

}  // namespace duet
