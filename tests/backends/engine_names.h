// The engines over which a suite runs, whether they are here or not.
#pragma once

#include <algorithm>

#include "duet/backends/engine_module.h"
#include "tests/support.h"

namespace duet::test {

inline std::vector<std::string> engine_names() { return {"mujoco", "bullet", "dart", "ode", "simbody"}; }
inline std::string engine_of(const ::testing::TestParamInfo<std::string>& info) { return info.param; }

inline bool is_here(const std::string& engine) {
  const std::vector<EngineInfo> known = engines();
  return std::ranges::any_of(known, [&](const EngineInfo& info) { return info.name == engine && info.available; });
}

}  // namespace duet::test
