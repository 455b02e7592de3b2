#include "duet/datasets/dataset_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>

#include "duet/core/digest.h"
#include "duet/core/json.h"
#include "duet/core/text.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSettingsFile = "dataset.json";
constexpr const char* kEntriesFile = "entries.jsonl";
constexpr const char* kLockFile = ".lock";

// Whole lines only: a process that was killed leaves a part of one.
void for_each_line(const std::string& text, const std::string& name,
                   const std::function<void(std::string_view, const std::string&)>& take) {
  std::size_t begin = 0;
  for (int number = 1; begin < text.size(); ++number) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) return;
    take(std::string_view(text).substr(begin, end - begin), fmt::format("'{}', line {}", name, number));
    begin = end + 1;
  }
}

std::map<std::string, DatasetEntry> entries_in(const std::string& folder) {
  std::map<std::string, DatasetEntry> entries;
  const std::string file = folder + "/" + kEntriesFile;
  if (!fs::exists(file)) return entries;
  for_each_line(read_file(file), file, [&](std::string_view line, const std::string& name) {
    DatasetEntry entry = parse_entry(line, name);
    entries.insert_or_assign(entry.clip, std::move(entry));
  });
  return entries;
}

// The first setting in which two data sets differ, as a sentence.
std::string difference(const nlohmann::json& there, const nlohmann::json& asked) {
  for (const auto& [key, value] : asked.items())
    if (!there.contains(key) || there[key] != value)
      return fmt::format("'{}' is {} there and {} now", key,
                         there.contains(key) ? shown(dumped(there[key])) : "not known", shown(dumped(value)));
  for (const auto& [key, value] : there.items())
    if (!asked.contains(key)) return fmt::format("'{}' is {} there and not known now", key, shown(dumped(value)));
  return "";
}

void check_settings(const std::string& folder, const nlohmann::json& settings) {
  const std::string file = inside(folder, kSettingsFile);
  if (fs::exists(file)) {
    const std::string differs = difference(read_dataset_settings(folder), settings);
    if (!differs.empty())
      throw InputError(
          fmt::format("'{}' is a data set that was made otherwise ({}): expected another folder, or the "
                      "same options to go on with it",
                      folder, differs));
    return;
  }
  for (const auto& item : fs::directory_iterator(folder))
    if (item.path().filename() != kLockFile)
      throw InputError(fmt::format("'{}': expected an empty folder or a data set of duet, found '{}' and no {}", folder,
                                   item.path().filename().string(), kSettingsFile));
  write_file(file, dumped(settings, 1) + "\n");
}

std::string created(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw StorageError(fmt::format("cannot create '{}': {}", folder, error.message()));
  return folder;
}

}  // namespace

DatasetFolder::DatasetFolder(const std::string& path, const nlohmann::json& settings)
    : path_(created(path)), lock_(inside(path, kLockFile)) {
  if (!lock_.try_lock(0))
    throw InputError(
        fmt::format("'{}': another process is making this data set: wait for it, or use another folder", path));
  check_settings(path_, settings);
  entries_ = entries_in(path_);
  log_ = std::make_unique<LineAppender>(inside(path_, kEntriesFile));
}

std::optional<DatasetEntry> DatasetFolder::find(const std::string& clip, const std::string& key) const {
  DatasetEntry found;
  {
    const std::lock_guard hold(mutex_);
    const auto entry = entries_.find(clip);
    if (entry == entries_.end() || entry->second.key != key) return std::nullopt;
    found = entry->second;
  }
  const bool whole = std::ranges::all_of(found.outputs, [&](const NamedDigest& output) {
    const std::string file = inside(path_, output.file);
    return fs::exists(file) && sha256_file(file) == output.sha256;
  });
  return whole ? std::optional(std::move(found)) : std::nullopt;
}

void DatasetFolder::append(const DatasetEntry& entry) {
  const std::lock_guard hold(mutex_);
  log_->append(entry_line(entry));
  entries_.insert_or_assign(entry.clip, entry);
}

std::vector<DatasetEntry> DatasetFolder::entries() const {
  const std::lock_guard hold(mutex_);
  std::vector<DatasetEntry> sorted;
  for (const auto& [clip, entry] : entries_) sorted.push_back(entry);
  return sorted;
}

std::vector<DatasetEntry> read_dataset(const std::string& path) {
  (void)read_dataset_settings(path);
  std::vector<DatasetEntry> sorted;
  for (auto& [clip, entry] : entries_in(path)) sorted.push_back(std::move(entry));
  return sorted;
}

nlohmann::json read_dataset_settings(const std::string& path) {
  const std::string file = path + "/" + kSettingsFile;
  if (!fs::exists(file))
    throw InputError(fmt::format("'{}': expected a data set of duet, found no {} in it", path, kSettingsFile));
  return parse_json(read_text(file), "'" + file + "'");
}

}  // namespace duet
