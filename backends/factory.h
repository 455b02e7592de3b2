// Engines by name. What this build lacks is listed with its reason and refused by name (MissingError).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "backends/backend.h"

namespace duet {

struct EngineInfo {
  std::string name;
  bool available = false;
  std::string version;  // where available
  std::string reason;   // why not, where not ("built without MuJoCo (DUET_WITH_MUJOCO=OFF)")
};

std::vector<EngineInfo> engines();

// Throws std::invalid_argument for an unknown name (with the nearest), MissingError for one that this build lacks.
std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene);

}  // namespace duet
