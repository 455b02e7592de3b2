// A kind of perturbation: how it is read, written, listed and documented. Made of a table of fields (core/field.h) by
// one of four forms below.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "duet/core/field.h"
#include "duet/robots/yaml_fields.h"
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

struct PerturbationKind {
  std::string name, meaning;
  std::vector<FieldRow> rows;  // of its mapping; of a kind that is one value, that value
  // Reads the mapping of a perturbation, which has the key. Throws InputError: file, line, expected, found.
  std::function<void(const YamlSection& item, const std::string& file, Perturbation& into)> read;
  std::function<std::string(const Perturbation& of)> write;       // "" where there is none of it
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
Plan read_plan(const YamlSection& item, const std::string& file, const std::string& name, const FieldTable<Plan>& table,
               const Plan& named) {
  const YamlSection mapping(file, item.node(name.c_str()), name, field_keys(table));
  Plan plan = mapping.keys().size() > 0 ? named : Plan();
  read_fields(mapping, table, plan);
  return plan;
}

// A kind whose values are a struct of its own: `slot` is the optional one of a perturbation.
template <typename Plan, typename Slot>
PerturbationKind planned_kind(std::string name, std::string meaning, FieldTable<Plan> table, Slot slot,
                              Plan named = {}) {
  PerturbationKind kind{name, std::move(meaning), field_rows(table, Plan()), {}, {}};
  kind.read = [name, table, slot, named](const YamlSection& item, const std::string& file, Perturbation& into) {
    slot(into) = read_plan(item, file, name, table, named);
  };
  kind.write = [table, slot](const Perturbation& of) { return slot(of) ? flow_mapping(table, *slot(of)) : ""; };
  kind.values = [table, slot](const Perturbation& of) {
    return slot(of) ? field_texts(table, *slot(of)) : FieldTexts();
  };
  return kind;
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
PerturbationKind robot_kind(std::string name, std::string meaning, FieldTable<Plan> table, Plan named = {}) {
  PerturbationKind kind{name, std::move(meaning), field_rows(table, Plan()), {}, {}};
  kind.read = [name, table, named](const YamlSection& item, const std::string& file, Perturbation& into) {
    into.robot.push_back(std::make_shared<const Plan>(read_plan(item, file, name, table, named)));
  };
  kind.write = [table](const Perturbation& of) {
    const Plan* plan = robot_plan<Plan>(of);
    return plan ? flow_mapping(table, *plan) : "";
  };
  kind.values = [table](const Perturbation& of) {
    const Plan* plan = robot_plan<Plan>(of);
    return plan ? field_texts(table, *plan) : FieldTexts();
  };
  return kind;
}

}  // namespace duet
