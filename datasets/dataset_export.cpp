#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/datasets/dataset.h"
#include "duet/datasets/dataset_card.h"
#include "duet/datasets/entry.h"
#include "duet/motion/paired_motion.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kLog = "exported.jsonl";

// One clip of one robot.
struct Item {
  const DatasetEntry* entry = nullptr;
  const DatasetRobot* robot = nullptr;
  NamedDigest source;
};

std::vector<Item> items_of(const std::vector<DatasetEntry>& entries, const std::vector<DatasetRobot>& robots,
                           const std::string& dataset) {
  std::vector<Item> items;
  for (const DatasetEntry& entry : entries) {
    if (entry.status != ClipStatus::kKept) continue;
    for (const auto& [name, figures] : entry.metrics) {
      const auto robot = std::ranges::find(robots, name, &DatasetRobot::name);
      if (robot == robots.end())
        throw InputError(fmt::format("'{}': its robot '{}' is not among those given", dataset, name));
      const auto source = std::ranges::find(entry.outputs, robot_file(name, entry.clip), &NamedDigest::file);
      if (source == entry.outputs.end())
        throw InputError(fmt::format("'{}': clip '{}' lists no motion of robot '{}'", dataset, entry.clip, name));
      items.push_back({.entry = &entry, .robot = &*robot, .source = *source});
    }
  }
  return items;
}

// The entry of one item, as it stands in log and manifest.
json row_of(const Item& item, const RobotMotionFormat& format, const RobotMotionWriting& writing,
            const std::vector<NamedDigest>& files) {
  json list = json::array();
  for (const NamedDigest& file : files) list.push_back({{"file", file.file}, {"sha256", file.sha256}});
  return {{"clip", item.entry->clip},
          {"task", item.entry->task},
          {"robot", item.robot->name},
          {"format", format.name},
          {"rate_hz", writing.rate_hz ? json(*writing.rate_hz) : json()},
          {"order", static_cast<int>(writing.order)},
          {"act", {{"begin_s", item.entry->act_begin}, {"end_s", item.entry->act_end}}},
          {"source", {{"file", item.source.file}, {"sha256", item.source.sha256}}},
          {"files", list}};
}

std::string name_of(const json& row) { return row["robot"].get<std::string>() + "/" + row["clip"].get<std::string>(); }

class Export {
 public:
  Export(const std::string& dataset, const std::string& output, const RobotMotionFormat& format,
         const RobotMotionWriting& writing)
      : dataset_(dataset), output_(output), format_(format), writing_(writing) {
    std::error_code error;
    fs::create_directories(output, error);
    if (error) throw StorageError(fmt::format("cannot create '{}': {}", output, error.message()));
    log_ = std::make_unique<LineAppender>(join_without_links(output, kLog));
    read_log();
  }

  // Whether it was there before. `has_object` is told of what is written now.
  bool make(const Item& item, bool& has_object) {
    if (is_there(item)) return true;
    const std::string bytes = read_file(dataset_ + "/" + item.source.file);
    if (sha256_hex(bytes) != item.source.sha256)
      throw InputError(fmt::format("'{}/{}' was changed since the data set was made (its digest differs)", dataset_,
                                   item.source.file));
    const PairedMotion paired = parse_paired_motion(bytes, item.source.file);
    has_object = !paired.object.empty();
    const std::string stem = item.robot->name + "/" + item.entry->clip;
    RobotMotionWriting writing = writing_;
    writing.name = item.entry->clip;
    std::vector<NamedDigest> files;
    for (const auto& [name, content] : robot_motion_files(paired.robot, *item.robot->model, format_, writing)) {
      const std::string file = name.empty() ? stem + format_.ending : fmt::format("{}/{}", stem, name);
      write_file(join_without_links(output_, file), content, Durability::kUnsynced);
      files.push_back({.file = file, .sha256 = sha256_hex(content)});
    }
    const json row = row_of(item, format_, writing_, files);
    const std::lock_guard hold(mutex_);
    log_->append(dumped(row));
    rows_[name_of(row)] = row;
    return false;
  }

  void write_manifest() const {
    json list = json::array();
    for (const auto& [name, row] : rows_) list.push_back(row);
    write_file(join_without_links(output_, "manifest.json"), dumped(list, 1) + "\n");
  }

 private:
  void read_log() {
    const std::string file = output_ + "/" + kLog;
    const std::string text = read_file(file);
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      json row = parse_json(std::string_view(text).substr(begin, end - begin), "'" + file + "'");
      const JsonNode node(row, "'" + file + "'");
      const std::string name = json_at<std::string>(node, "robot") + "/" + json_at<std::string>(node, "clip");
      rows_[name] = std::move(row);
      begin = end + 1;
    }
  }

  bool is_there(const Item& item) {
    json row;
    {
      const std::lock_guard hold(mutex_);
      const auto found = rows_.find(item.robot->name + "/" + item.entry->clip);
      if (found == rows_.end()) return false;
      row = found->second;
    }
    std::vector<NamedDigest> files;
    for (const json& file : row["files"]) files.push_back({.file = file["file"], .sha256 = file["sha256"]});
    if (row != row_of(item, format_, writing_, files)) return false;
    return std::ranges::all_of(files, [&](const NamedDigest& file) {
      const std::string path = join_without_links(output_, file.file);
      return fs::exists(path) && sha256_file(path) == file.sha256;
    });
  }

  const std::string& dataset_;
  const std::string& output_;
  const RobotMotionFormat& format_;
  const RobotMotionWriting& writing_;
  std::mutex mutex_;
  std::map<std::string, json> rows_;
  std::unique_ptr<LineAppender> log_;
};

}  // namespace

DatasetExport export_dataset(const std::string& dataset, const std::string& output,
                             const std::vector<DatasetRobot>& robots, const RobotMotionFormat& format,
                             const RobotMotionWriting& writing, int threads, const DatasetEvents& events) {
  require(format.write != nullptr, "format '{}' is read, not written", format.name);
  const std::vector<DatasetEntry> entries = read_dataset(dataset);
  const std::vector<Item> items = items_of(entries, robots, dataset);
  Export work(dataset, output, format, writing);
  DatasetExport result;
  std::mutex mutex;
  if (events.found) events.found(static_cast<int>(items.size()));
  parallel_for_each(static_cast<int>(items.size()), threads, [&](int i) {
    {
      const std::lock_guard hold(mutex);
      result.stopped = result.stopped || (events.stop && events.stop());
      if (result.stopped) return;
    }
    const Item& item = items[static_cast<std::size_t>(i)];
    bool has_object = false;
    const bool from_before = work.make(item, has_object);
    const std::lock_guard hold(mutex);
    ++result.motions;
    result.from_before += from_before;
    result.objects_left_out += has_object;
    if (events.finished) events.finished(*item.entry, from_before);
  });
  work.write_manifest();
  return result;
}

}  // namespace duet
