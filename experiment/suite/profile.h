// An engine profile: physics step and solver settings of each engine, in a plain file (profiles/*.yaml) that an
// engine's authors can send a patch for. docs/file-formats.md, "Engine profile".
#pragma once

#include <yaml-cpp/yaml.h>

#include <map>
#include <string>
#include <vector>

#include "duet/backends/actuation.h"
#include "duet/backends/backend.h"

namespace duet {

struct EngineSettings {
  double dt = 0.002;  // physics step [s]
  EngineOptions options;
  TorqueLaw law = TorqueLaw::kImplicit;
  double armature = 1.0;  // share of the card's
};

struct Profile {
  std::string name;
  std::string about;  // one sentence for `duet list profiles`
  std::map<std::string, EngineSettings> engines;

  // Settings of an engine; one that the file does not name has the defaults.
  [[nodiscard]] EngineSettings settings(const std::string& engine) const;
};

// Reads a document: the file's, or the mapping of a suite's `profile` key, which leaves out the schema.
Profile read_profile(const YAML::Node& document, const std::string& file);

// `profile` is a path, or the name of one that ships with duet ("parity"). Throws InputError (file, line, key,
// expected, found; an engine or option that is unknown; a step that does not divide 0.02 s), std::invalid_argument for
// a name that is neither, with the nearest. Options of an engine that this machine lacks are not checked.
Profile load_profile(const std::string& profile);

// Whether this machine has an engine of that name.
bool is_available(const std::string& engine);

// Names of the profiles that ship with duet.
std::vector<std::string> profile_names();

// One line of YAML, "{dt: 0.002, iterations: 20}", with what the settings say; law and armature where they are not the
// implicit one and the card's.
std::string settings_yaml(const EngineSettings& settings);
// The same with every option of the engine written out where it is present; and its SHA-256, what rows carry.
std::string resolved_settings(const std::string& engine, const EngineSettings& settings);
std::string settings_digest(const std::string& engine, const EngineSettings& settings);

}  // namespace duet
