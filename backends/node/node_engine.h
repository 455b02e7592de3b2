// The engines whose library is a package of npm, in a host of Node.js (host.mjs): absent until `./run setup --engines`
// has installed their packages.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "duet/backends/backend.h"
#include "duet/backends/engine_module.h"

namespace duet {

// `package` of npm in exactly this version, as package-lock.json beside this file has it.
struct NodeEngine {
  std::string engine;           // "mujoco3": ENGINE.mjs is beside this file
  std::string package;          // "@mujoco/mujoco"
  std::string package_version;  // "3.14.0"
  std::string engine_version;   // that the host answers with
};

// One sentence: the package is not installed or has another version, Node.js is not there or too old. "": it can run.
std::string absence_of(const NodeEngine& engine);

// For an engine of which absence_of says nothing. Throws what make_host_backend throws.
std::unique_ptr<Backend> make_node_backend(const NodeEngine& engine, const Scene& scene,
                                           std::span<const EngineOption> options);

}  // namespace duet
