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

json json_of(const std::vector<NamedDigest>& files) {
  json list = json::array();
  for (const NamedDigest& file : files) list.push_back({{"file", file.file}, {"sha256", file.sha256}});
  return list;
}

json json_of(const std::map<std::string, double>& values) {
  json object = json::object();
  for (const auto& [name, value] : values) object[name] = number_or_null(value);
  return object;
}

json json_of(const ClipStatistics& statistics) {
  json object = {{"seconds", statistics.seconds}};
  for (const StatisticInfo& info : clip_statistic_catalogue()) object[info.name] = statistics.*info.value;
  return object;
}

std::vector<std::string> texts(JsonFields& fields, const std::string& key, const std::string& what) {
  const json& list = fields.at(key);
  std::vector<std::string> result;
  if (!list.is_array()) throw InputError(fmt::format("{}: '{}' is no list", what, key));
  for (const json& text : list) {
    if (!text.is_string()) throw InputError(fmt::format("{}: '{}' holds something that is no text", what, key));
    result.push_back(text);
  }
  return result;
}

std::vector<NamedDigest> digests(JsonFields& fields, const std::string& key, const std::string& what) {
  const json& list = fields.at(key);
  if (!list.is_array()) throw InputError(fmt::format("{}: '{}' is no list", what, key));
  std::vector<NamedDigest> result;
  for (const json& item : list) {
    JsonFields file(item, fmt::format("{}: {}", what, key));
    result.push_back({.file = file.text("file"), .sha256 = file.text("sha256")});
    file.refuse_unknown();
  }
  return result;
}

std::map<std::string, std::string> text_map(JsonFields& fields, const std::string& key, const std::string& what) {
  const json& object = fields.at(key);
  std::map<std::string, std::string> result;
  if (!object.is_object()) throw InputError(fmt::format("{}: '{}' is no object", what, key));
  for (const auto& [name, text] : object.items()) {
    if (!text.is_string()) throw InputError(fmt::format("{}: '{}.{}' is no text", what, key, name));
    result[name] = text;
  }
  return result;
}

ClipStatus status_of(const std::string& text, const std::string& what) {
  for (const ClipStatus status : kStatuses)
    if (to_string(status) == text) return status;
  throw InputError(fmt::format("{}: unknown status '{}'", what, text));
}

ClipStatistics statistics_of(JsonFields& fields, const std::string& what) {
  JsonFields values(fields.at("statistics"), what + ": statistics");
  ClipStatistics result{.seconds = values.number("seconds")};
  for (const StatisticInfo& info : clip_statistic_catalogue())
    result.*info.value = values.number(std::string(info.name));
  values.refuse_unknown();
  return result;
}

std::map<std::string, std::map<std::string, double>> metrics_of(JsonFields& fields, const std::string& what) {
  const json& object = fields.at("metrics");
  if (!object.is_object()) throw InputError(fmt::format("{}: 'metrics' is no object", what));
  JsonFields robots(object, what + ": metrics");
  std::map<std::string, std::map<std::string, double>> result;
  for (const auto& [robot, values] : object.items()) result[robot] = robots.numbers(robot, true);
  return result;
}

}  // namespace

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

std::string entry_line(const DatasetEntry& entry) {
  json metrics = json::object();
  for (const auto& [robot, values] : entry.metrics) metrics[robot] = json_of(values);
  return dumped(nlohmann::json({{"clip", entry.clip},
                                {"key", entry.key},
                                {"status", to_string(entry.status)},
                                {"gates", entry.gates},
                                {"reasons", entry.reasons},
                                {"format", entry.format},
                                {"licence", entry.licence},
                                {"label", entry.label},
                                {"sources", json_of(entry.sources)},
                                {"evidence", entry.evidence},
                                {"provenance", entry.provenance},
                                {"task", entry.task},
                                {"reactor", entry.reactor},
                                {"frames", entry.frames},
                                {"act", {{"begin_s", entry.act_begin}, {"end_s", entry.act_end}}},
                                {"statistics", json_of(entry.statistics)},
                                {"criteria", json_of(entry.criteria)},
                                {"outputs", json_of(entry.outputs)},
                                {"metrics", metrics}}));
}

DatasetEntry parse_entry(std::string_view line, const std::string& name) {
  const json parsed = parse_json(line, name);
  JsonFields fields(parsed, name);
  DatasetEntry entry{.clip = fields.text("clip"),
                     .key = fields.text("key"),
                     .status = status_of(fields.text("status"), name),
                     .gates = texts(fields, "gates", name),
                     .reasons = texts(fields, "reasons", name),
                     .format = fields.text("format"),
                     .licence = fields.text("licence"),
                     .label = fields.text("label"),
                     .sources = digests(fields, "sources", name),
                     .evidence = texts(fields, "evidence", name),
                     .provenance = text_map(fields, "provenance", name),
                     .task = fields.text("task"),
                     .reactor = fields.text("reactor"),
                     .frames = static_cast<int>(std::clamp<std::int64_t>(fields.integer("frames"), 0, 1 << 30))};
  JsonFields act(fields.at("act"), name + ": act");
  entry.act_begin = act.number("begin_s");
  entry.act_end = act.number("end_s");
  act.refuse_unknown();
  entry.statistics = statistics_of(fields, name);
  entry.criteria = fields.numbers("criteria", true);
  entry.outputs = digests(fields, "outputs", name);
  entry.metrics = metrics_of(fields, name);
  fields.refuse_unknown();
  return entry;
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
