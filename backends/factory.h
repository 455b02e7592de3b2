// Engines by name: the modules duet_<engine>.so that are found (backends/engine_module.h) in the folders $DUET_ENGINES
// ("mine:/usr/lib/duet/engines") if it is set, else in the first of these that is there: `engines` beside the program,
// lib/duet/engines of an installed duet (core/share.h), where it was built. Missing engines are listed with their
// reason and refused by name (MissingError). Thread-safe; a module is loaded once and stays.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/engine_module.h"

namespace duet {

struct EngineInfo {
  std::string name;
  bool available = false;
  std::string version;  // where available
  std::string reason;   // why not, where not ("libode.so.8: cannot open shared object file")
};

// The five engines of the benchmark whether present or not, then other modules by name.
std::vector<EngineInfo> engines();

// Throws std::invalid_argument for an unknown name (with the nearest), options that the engine does not have and a
// scene that it refuses; MissingError for an engine that this machine lacks.
std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene);

// Throws as make_backend.
const EngineModule& engine_module(const std::string& engine);
// Null where there is none of that name, or where this machine lacks it.
const EngineModule* find_engine_module(const std::string& engine);

}  // namespace duet
