// One key of a suite: how it is read, written in the resolved form (which is hashed), and what is said of it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/yaml_section.h"

namespace duet {

struct SuiteKey {
  std::string name;            // of the top level
  std::vector<FieldRow> rows;  // of it and of what is below it, dots in their names
  // Whether a suite whose roots move by command (`reference`) has it.
  enum class With { kBoth, kClips, kReference } with = With::kBoth;
  std::function<void(const YamlSection& top, Suite& suite)> read = {};  // throws InputError; suite.file is set
  std::function<std::string(const Suite& suite)> write = {};            // whole lines, or ""
};

}  // namespace duet
