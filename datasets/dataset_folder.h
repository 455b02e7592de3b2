// A data set on disk: dataset.json (what makes it), entries.jsonl (one line a clip, appended as each is finished), and
// what is derived from them. A killed command goes on where it stopped; one process works in a folder at a time.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/file.h"
#include "duet/datasets/entry.h"
#include "duet/rows/folder/folder_lock.h"

namespace duet {

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
