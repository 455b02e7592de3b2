#include "duet/datasets/entry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

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

}  // namespace duet
