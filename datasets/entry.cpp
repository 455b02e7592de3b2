#include "duet/datasets/entry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "duet/core/digest.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

using nlohmann::json;

constexpr std::array kStatuses = {ClipStatus::kKept, ClipStatus::kRejected, ClipStatus::kOther, ClipStatus::kFailed};

std::vector<std::string> status_names() {
  std::vector<std::string> names;
  for (const ClipStatus status : kStatuses) names.emplace_back(to_string(status));
  return names;
}

}  // namespace

template <>
const JsonSchema<NamedDigest>& json_schema<NamedDigest>() {
  static const JsonSchema<NamedDigest> schema = {{{"file"}, &NamedDigest::file}, {{"sha256"}, &NamedDigest::sha256}};
  return schema;
}

template <>
const JsonSchema<ClipStatistics>& json_schema<ClipStatistics>() {
  static const JsonSchema<ClipStatistics> schema = [] {
    JsonSchema<ClipStatistics> keys = {{finite_key("seconds"), &ClipStatistics::seconds}};
    for (const StatisticInfo& info : clip_statistic_catalogue())
      keys.emplace_back(finite_key(std::string(info.name)), info.value);
    return keys;
  }();
  return schema;
}

template <>
const JsonSchema<DatasetEntry>& json_schema<DatasetEntry>() {
  using E = DatasetEntry;
  static const JsonSchema<E> schema = {
      {{"clip"}, &E::clip},
      {{"key"}, &E::key},
      {{.name = "status", .choices = status_names()}, &E::status},
      {{"gates"}, &E::gates},
      {{"reasons"}, &E::reasons},
      {{"format"}, &E::format},
      {{"licence"}, &E::licence},
      {{"label"}, &E::label},
      {{"sources"}, &E::sources},
      {{"evidence"}, &E::evidence},
      {{"provenance"}, &E::provenance},
      {{"task"}, &E::task},
      {{"reactor"}, &E::reactor},
      {{.name = "made_up", .optional = true}, &E::made_up},
      {{"frames"}, &E::frames},
      json_group<E>({"act"}, {{finite_key("begin_s"), &E::act_begin}, {finite_key("end_s"), &E::act_end}}),
      {{"statistics"}, &E::statistics},
      {{"criteria"}, &E::criteria},
      {{"outputs"}, &E::outputs},
      {{"metrics"}, &E::metrics}};
  return schema;
}

std::string_view to_string(ClipStatus status) {
  switch (status) {
    case ClipStatus::kKept:
      return "kept";
    case ClipStatus::kRejected:
      return "rejected";
    case ClipStatus::kOther:
      return "other task";
    case ClipStatus::kFailed:
      return "failed";
  }
  return "";
}

std::string entry_line(const DatasetEntry& entry) { return dumped(json_mapping(entry)); }

DatasetEntry parse_entry(std::string_view line, const std::string& name) {
  const json parsed = parse_json(line, name);
  return read_mapping<DatasetEntry>(JsonNode(parsed, name));
}

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
                         there.contains(key) ? excerpt(dumped(there[key])) : "not known", excerpt(dumped(value)));
  for (const auto& [key, value] : there.items())
    if (!asked.contains(key)) return fmt::format("'{}' is {} there and not known now", key, excerpt(dumped(value)));
  return "";
}

void check_settings(const std::string& folder, const nlohmann::json& settings) {
  const std::string file = join_without_links(folder, kSettingsFile);
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
    : path_(created(path)), lock_(join_without_links(path, kLockFile)) {
  if (!lock_.try_lock(0))
    throw InputError(
        fmt::format("'{}': another process is making this data set: wait for it, or use another folder", path));
  check_settings(path_, settings);
  entries_ = entries_in(path_);
  log_ = std::make_unique<LineAppender>(join_without_links(path_, kEntriesFile));
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
    const std::string file = join_without_links(path_, output.file);
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
