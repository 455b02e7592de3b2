// One key of a suite: how it is read, written in the resolved form (which is hashed), and what is said of it.
#pragma once

#include <utility>

#include "duet/experiment/suite/suite.h"
#include "duet/robots/yaml_schema.h"

namespace duet {

struct SuiteKey : SchemaKey<Suite> {
  // Whether a suite whose roots move by command (`reference`) has it.
  enum class With { kBoth, kClips, kReference };

  SuiteKey(SchemaKey<Suite> key, With where = With::kBoth) : SchemaKey<Suite>(std::move(key)), with(where) {}

  With with;
};

}  // namespace duet
