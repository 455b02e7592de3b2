// A run on disk, append-only and resumable: run.json, env.json, suite.yaml, episodes.jsonl and, where a run was
// resumed, resumed.jsonl (when, command line and environment of each resumption); everything else is derived.
// ARCHITECTURE decision 9.
#pragma once

#include <memory>
#include <string>
#include <unordered_set>
#include <vector>

#include "core/file.h"
#include "results/episode_row.h"

namespace duet {

struct RunInfo {
  std::string suite, suite_version, suite_hash;
  std::string suite_yaml;  // resolved
  std::vector<std::string> argv;
  std::string created_at;      // UTC, ISO 8601
  nlohmann::json environment;  // results/environment.h
  nlohmann::json certificate;  // parity certificate of the engines (results/certificate.h), null where none is attached
};

class RunDirectory {
 public:
  // Creates the folder, or opens it to resume. Throws InputError: the folder holds a run of another suite (names both),
  // is not a run and not empty, is published, cannot be written.
  static RunDirectory open(const std::string& path, const RunInfo& info);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] bool has(const std::string& key) const { return keys_.contains(key); }
  [[nodiscard]] std::size_t size() const { return keys_.size(); }
  // On disk when it returns. Throws InputError (a full disk); the file then ends with the last whole row.
  // std::invalid_argument for a key that is empty or already there and for a row of another suite. Not thread-safe.
  void append(const EpisodeRow& row);

 private:
  RunDirectory() = default;
  std::string path_, suite_hash_;
  std::unordered_set<std::string> keys_;
  std::unique_ptr<LineAppender> lines_;
};

struct Run {
  RunInfo info;
  std::vector<EpisodeRow> rows;  // in file order, last incomplete line dropped
  int dropped_lines = 0;
};

// Throws InputError: not a run directory, a broken row (file and line), a key twice, a row of another suite, a
// published run that is not what was published (results/published.h).
Run load_run(const std::string& path);

}  // namespace duet
