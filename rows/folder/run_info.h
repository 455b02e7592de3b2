// run.json: which run a folder holds, and how many episodes it is to have. docs/file-formats.md, "Run directory".
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace duet {

// A part of a suite that somebody asked for: names; an empty list stands for all. The null arm belongs to each.
struct RunPart {
  std::vector<std::string> engines, controllers, policies, tasks, perturbations;

  bool operator==(const RunPart&) const = default;
  [[nodiscard]] bool is_whole() const { return *this == RunPart(); }
};

// How many episodes a run is to have: the whole suite, and all parts together that were asked for so far.
struct RunPlan {
  std::int64_t episodes = 0, asked = 0;
  std::vector<RunPart> parts;  // one that is whole stands alone

  bool operator==(const RunPlan&) const = default;
};

struct RunInfo {
  std::string suite, suite_version, suite_hash;
  std::string suite_yaml;  // resolved
  std::vector<std::string> argv;
  std::string created_at;                                    // UTC, ISO 8601
  nlohmann::json environment;                                // rows/folder/environment.h
  std::map<std::string, std::string> policies, controllers;  // name -> digest, "" where its files were not there
  nlohmann::json certificate;   // parity certificate of the engines (report/engines/certificate_table.h), null where
                                // none is attached
  std::optional<RunPlan> plan;  // none: no clip was ready yet, or the run is of a program that kept no plan
};

// `parts` with one more, in a form that tells equal ones: names sorted, each part once, one that is whole alone.
std::vector<RunPart> with_part(std::vector<RunPart> parts, RunPart part);

// The text of run.json; environment and suite_yaml have files of their own.
std::string run_json(const RunInfo& info);
// Throws InputError: file, key, expected, found.
RunInfo read_run_json(const std::string& path);

// "tiny@1.0.0 (0123456789ab)".
std::string suite_label(const std::string& suite, const std::string& version, const std::string& hash);
std::string suite_label(const RunInfo& info);

}  // namespace duet
