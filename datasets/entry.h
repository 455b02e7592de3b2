// The record of a clip of a data set, kept or not: its origin, why it was refused, what was made of it. One line
// of JSON in the data set's log; the tables and the card are made of nothing else.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/file.h"
#include "duet/metrics/clip_statistics.h"
#include "duet/rows/folder/run_files.h"

namespace duet {

enum class ClipStatus {
  kKept,
  kRejected,  // a gate refused it
  kOther,     // its label is none of duet's tasks
  kFailed     // it could not be read or retargeted
};
std::string_view to_string(ClipStatus status);  // "kept", "rejected", "other task", "failed"

struct NamedDigest {
  std::string file;    // of a source: its name without folders; of what was made: relative to the data set
  std::string sha256;  // 64 hex digits
  bool operator==(const NamedDigest&) const = default;
};

struct DatasetEntry {
  std::string clip = {};  // its id in the data set
  std::string key = {};   // digest of the source files and of all options: the same key is the same work
  ClipStatus status = ClipStatus::kFailed;
  std::vector<std::string> gates = {};    // that refused it
  std::vector<std::string> reasons = {};  // one sentence each
  std::string format = {}, licence = {}, label = {};
  std::vector<NamedDigest> sources = {};
  std::vector<std::string> evidence = {};  // what was found of unit, axes, rate, floor, ...
  std::map<std::string, std::string> provenance = {};
  std::string task = {}, reactor = {};
  std::map<std::string, double> made_up = {};   // share of frames by kind ("legs"); motion/people/made_up.h
  int frames = 0;                               // at 50 Hz
  double act_begin = 0.0, act_end = 0.0;        // [s]
  ClipStatistics statistics = {};               // zero seconds: none were made
  std::map<std::string, double> criteria = {};  // of the gates
  std::vector<NamedDigest> outputs = {};
  std::map<std::string, std::map<std::string, double>> metrics = {};  // robot -> figure -> value
};

// One line without a newline, and back. Throws InputError naming `name` and the fault.
std::string entry_line(const DatasetEntry& entry);
DatasetEntry parse_entry(std::string_view line, const std::string& name);

// A data set on disk: dataset.json (what makes it), entries.jsonl (one line a clip, appended as each is finished), and
// what is derived from them. A killed command goes on where it stopped; one process works in a folder at a time.

class DatasetFolder {
 public:
  // Creates it, or opens it to go on. Throws InputError: the folder is another data set (names the first setting that
  // differs), or is neither empty nor a data set; another process works in it. StorageError: it cannot be written.
  DatasetFolder(const std::string& path, const nlohmann::json& settings);

  [[nodiscard]] const std::string& path() const { return path_; }
  // The entry of a clip that was finished before with this key and whose outputs are all still there and whole.
  // Thread-safe.
  [[nodiscard]] std::optional<DatasetEntry> find(const std::string& clip, const std::string& key) const;
  // On disk when it returns; a later entry of a clip stands for the earlier. Thread-safe. Throws StorageError.
  void append(const DatasetEntry& entry);
  // All entries, in the order of their ids.
  [[nodiscard]] std::vector<DatasetEntry> entries() const;

 private:
  std::string path_;
  FolderLock lock_;
  mutable std::mutex mutex_;
  std::map<std::string, DatasetEntry> entries_;
  std::unique_ptr<LineAppender> log_;
};

// The entries of a data set that is there, for reading. Throws InputError naming file and line.
std::vector<DatasetEntry> read_dataset(const std::string& path);
nlohmann::json read_dataset_settings(const std::string& path);

}  // namespace duet
