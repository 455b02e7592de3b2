// Two engine profiles as switches: what differs between them, in groups that mean one thing in every engine (law,
// armature, dt, softness of contacts, friction, solver), and the suite of each cell of the factorial over them. A cell
// is a set of switches, as bits (statistics/factorial.h).
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/experiment/suite/profile.h"
#include "duet/experiment/suite/suite.h"

namespace duet {

// A setting on both sides, as profiles write it; none where the profile leaves it to the engine.
struct SettingChange {
  std::string engine, key;
  std::optional<std::string> from, to;
};

struct EngineSwitch {
  std::string name;                    // "law", "softness"; "engine" where it puts another engine in the place of one
  std::vector<SettingChange> changes;  // of every engine that differs
  std::size_t engines = 1;             // of the suite: what all of them turn alike is said once

  // "dt 0.002 -> 0.001", with the engine where engines differ in it.
  [[nodiscard]] std::string text() const;
};

struct SwitchOptions {
  std::string from = {},
              to = {};  // a profile, a file, or settings: "law=explicit,dt=0.001"; from "": the suite's profile
  std::map<std::string, std::string> names = {};  // key -> name of the switch it belongs to, before the usual groups
};

// The group of settings that a key belongs to in any engine; the key itself where it is none of duet's.
std::string switch_of(const std::string& key);

class SwitchedSuite {
 public:
  // `suite`: with the engines that are to run; playback is left out, and so are the null arm and the controls.
  // Settings of `from` and `to` stand on what the suite's profile and `from` say; "mujoco.cone=pyramidal" is of one
  // engine, "engine=NAME" another engine in the place of the suite's only one. Throws InputError and
  // std::invalid_argument: profiles that are the same or differ in more than kMostSwitches switches (with their names),
  // a setting that an engine lacks, MissingError for an engine that is not on this machine.
  SwitchedSuite(Suite suite, const SwitchOptions& options);

  [[nodiscard]] const std::vector<EngineSwitch>& switches() const { return switches_; }
  [[nodiscard]] std::vector<std::string> names() const;
  [[nodiscard]] unsigned cells() const { return 1U << switches_.size(); }
  // "from", "law", "law+armature", ..., "to".
  [[nodiscard]] std::string cell_name(unsigned cell) const;
  // The suite with the switches of the cell turned. Its profile bears the cell's name.
  [[nodiscard]] Suite cell(unsigned cell) const;
  // The engine whose place another one takes in some cells; a name that is no such engine's stays.
  [[nodiscard]] std::string engine_of(const std::string& engine) const {
    return !other_engine_.empty() && engine == other_engine_ ? suite_.engines.front() : engine;
  }

 private:
  using Settings = std::map<std::string, std::optional<std::string>>;  // by key
  using Sides = std::map<std::string, Settings>;                       // by engine
  void take(const Sides& from, const Sides& to, const SwitchOptions& options);

  Suite suite_;
  std::string other_engine_;
  Sides from_;
  std::vector<EngineSwitch> switches_;
};

}  // namespace duet
