// run.json: which run a folder holds, and how many episodes it is to have. docs/file-formats.md, "Run directory".
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "duet/rows/episode_row.h"

namespace duet {

// A part of a suite that somebody asked for: names; an empty list stands for all. The null arm belongs to each.
struct EpisodeFilter {
  std::vector<std::string> engines, controllers, policies, tasks, perturbations;

  bool operator==(const EpisodeFilter&) const = default;
  [[nodiscard]] bool is_whole() const { return *this == EpisodeFilter(); }
};

// How many episodes a run is to have: the whole suite, and all parts together that were asked for so far.
struct RunPlan {
  std::int64_t episodes = 0, asked = 0;
  std::vector<EpisodeFilter> parts;  // one that is whole stands alone

  bool operator==(const RunPlan&) const = default;
};

struct RunInfo {
  std::string suite, suite_version, suite_hash;
  std::string suite_yaml;                 // resolved
  std::string suite_file = "suite.yaml";  // where it was read: its paths begin at that file's folder
  std::vector<std::string> argv;
  std::string created_at;                                    // UTC, ISO 8601
  nlohmann::json environment;                                // rows/folder/environment.h
  std::map<std::string, std::string> policies, controllers;  // name -> digest, "" where its files were not there
  nlohmann::json certificate;   // parity certificate of the engines (report/engines/cross_engine.h), null where
                                // none is attached
  std::optional<RunPlan> plan;  // none: no clip was ready yet, or the run is of a program that kept no plan
};

// `parts` with one more, in a form that tells equal ones: names sorted, each part once, one that is whole alone.
std::vector<EpisodeFilter> with_part(std::vector<EpisodeFilter> parts, EpisodeFilter part);

// The text of run.json; environment and suite_yaml have files of their own.
std::string run_json(const RunInfo& info);
// Throws InputError: file, key, expected, found.
RunInfo read_run_json(const std::string& path);

// "tiny@1.0.0 (0123456789ab)".
std::string suite_label(const std::string& suite, const std::string& version, const std::string& hash);
std::string suite_label(const RunInfo& info);

// Which digest a name in rows stands for. Rows that say "dstar" and were made by two networks are of two policies: they
// are never in one table, one run or one merge.

class IdentityCheck {
 public:
  // `kind`: "policy"; `where`: for messages. Throws InputError where the name stands for another digest already: both,
  // and where each was found. An empty digest is one too: of a policy whose files are not there.
  void add(const std::string& kind, const std::string& name, const std::string& digest, const std::string& where);
  // Policy, controller and, of an episode that ran in an engine, the engine with its resolved profile.
  void add(const EpisodeRow& row, const std::string& where);
  // Adds the policies and controllers of a run.json; one that was absent then may have come since.
  void add(const RunInfo& info, const std::string& where);

 private:
  struct Place {
    std::string digest, where;
  };
  std::map<std::pair<std::string, std::string>, Place> places_;  // by kind and name
};

// "12ab34cd56ef", "absent" for an empty one.
std::string short_digest(const std::string& digest);

}  // namespace duet
