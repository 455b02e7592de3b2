// The kinds of perturbation: one table, from which they are read, written, hashed, listed and documented. A new kind is
// its values (rollout/perturbation.h), a row here, and what it does.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/perturbation.h"

namespace duet {

struct PerturbationKind {
  std::string name, meaning;
  std::vector<FieldRow> rows;  // of its mapping; of a kind that is one value, that value
  // From the mapping of a perturbation, which has the key. Throws InputError: file, line, expected, found.
  std::function<void(const YamlSection& item, const std::string& file, Perturbation& into)> read;
  std::function<std::string(const Perturbation& of)> write;  // "" where there is none of it
  std::string fallback = "{}";                               // what the name alone stands for
};

const std::vector<PerturbationKind>& perturbation_kind_table();

}  // namespace duet
