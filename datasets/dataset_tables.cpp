#include "duet/datasets/dataset_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "duet/core/task.h"
#include "duet/datasets/curation.h"
#include "duet/metrics/catalogue.h"

namespace duet {
namespace {

std::vector<ClipStatistics> statistics_of(std::span<const DatasetEntry> entries, bool kept_only) {
  std::vector<ClipStatistics> result;
  for (const DatasetEntry& entry : entries)
    if (entry.statistics.seconds > 0.0 && (!kept_only || entry.status == ClipStatus::kKept))
      result.push_back(entry.statistics);
  return result;
}

std::string change(double before, double after) {
  return before > 0.0 ? fmt::format("{:+.2f} %", 100.0 * (after / before - 1.0)) : "-";
}

struct TaskSum {
  int clips = 0;
  long frames = 0;
  double seconds = 0.0;

  void add(const DatasetEntry& entry) {
    ++clips;
    frames += entry.frames;
    seconds += entry.statistics.seconds;
  }
};

std::vector<std::string> task_row(const std::string& name, const TaskSum& sum) {
  const double clips = std::max(1, sum.clips);
  return {name,
          std::to_string(sum.clips),
          std::to_string(sum.frames),
          fmt::format("{:.1f}", sum.seconds),
          fmt::format("{:.0f}", static_cast<double>(sum.frames) / clips),
          fmt::format("{:.1f}", sum.seconds / clips)};
}

std::string joined(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : "; ") + sentence;
  return text;
}

std::string picture_of(const DatasetEntry& entry) {
  for (const NamedDigest& output : entry.outputs)
    if (output.file.ends_with(".svg")) return output.file;
  return "";
}

// Mean over the kept clips that have a finite value; NaN for none.
double mean_of(std::span<const DatasetEntry> entries, const std::string& robot, const std::string& metric) {
  double sum = 0.0;
  int count = 0;
  for (const DatasetEntry& entry : entries) {
    if (entry.status != ClipStatus::kKept || !entry.metrics.contains(robot)) continue;
    const auto& figures = entry.metrics.at(robot);
    const auto value = figures.find(metric);
    if (value == figures.end() || !std::isfinite(value->second)) continue;
    sum += value->second;
    ++count;
  }
  return count > 0 ? sum / count : std::nan("");
}

std::vector<std::string> robots_of(std::span<const DatasetEntry> entries) {
  std::vector<std::string> names;
  for (const DatasetEntry& entry : entries)
    for (const auto& [robot, figures] : entry.metrics)
      if (std::ranges::count(names, robot) == 0) names.push_back(robot);
  std::ranges::sort(names);
  return names;
}

}  // namespace

TextTable curation_table(std::span<const DatasetEntry> entries) {
  const std::vector<ClipStatistics> all = statistics_of(entries, false), kept = statistics_of(entries, true);
  const ClipStatistics before = pooled(all), after = pooled(kept);
  TextTable table{.header = {"statistic", "unit", "before", "after", "change"}, .rows = {}, .label_columns = 2};
  for (const StatisticInfo& info : clip_statistic_catalogue())
    table.rows.push_back({std::string(info.title), std::string(info.unit), fmt::format("{:.4f}", before.*info.value),
                          fmt::format("{:.4f}", after.*info.value), change(before.*info.value, after.*info.value)});
  table.rows.push_back({"Clips", "", std::to_string(all.size()), std::to_string(kept.size()),
                        change(static_cast<double>(all.size()), static_cast<double>(kept.size()))});
  return table;
}

TextTable task_table(std::span<const DatasetEntry> entries) {
  TextTable table{.header = {"task", "samples", "frames", "duration s", "frames a sample", "s a sample"}, .rows = {}};
  TaskSum total;
  for (const Task task : all_tasks()) {
    TaskSum sum;
    for (const DatasetEntry& entry : entries)
      if (entry.status == ClipStatus::kKept && entry.task == to_string(task)) sum.add(entry);
    if (sum.clips == 0) continue;
    table.rows.push_back(task_row(std::string(to_string(task)), sum));
    total.clips += sum.clips;
    total.frames += sum.frames;
    total.seconds += sum.seconds;
  }
  table.rows.push_back(task_row("total", total));
  return table;
}

TextTable outcome_table(std::span<const DatasetEntry> entries) {
  TextTable table{.header = {"outcome", "clips", "share"}, .rows = {}};
  const auto add = [&](const std::string& name, long count) {
    const double share =
        entries.empty() ? 0.0 : 100.0 * static_cast<double>(count) / static_cast<double>(entries.size());
    table.rows.push_back({name, std::to_string(count), fmt::format("{:.1f} %", share)});
  };
  for (const ClipStatus status : {ClipStatus::kKept, ClipStatus::kRejected, ClipStatus::kOther, ClipStatus::kFailed}) {
    add(std::string(to_string(status)),
        std::ranges::count_if(entries, [&](const DatasetEntry& entry) { return entry.status == status; }));
    if (status != ClipStatus::kRejected) continue;
    for (const Gate gate : all_gates())
      add(fmt::format("  by {}", to_string(gate)), std::ranges::count_if(entries, [&](const DatasetEntry& entry) {
            return std::ranges::count(entry.gates, to_string(gate)) > 0;
          }));
  }
  return table;
}

TextTable refused_table(std::span<const DatasetEntry> entries) {
  TextTable table{.header = {"clip", "outcome", "gates", "reasons", "worst frame"}, .rows = {}, .label_columns = 5};
  for (const DatasetEntry& entry : entries)
    if (entry.status != ClipStatus::kKept)
      table.rows.push_back({entry.clip, std::string(to_string(entry.status)), joined(entry.gates),
                            joined(entry.reasons), picture_of(entry)});
  return table;
}

TextTable retargeting_table(std::span<const DatasetEntry> entries) {
  const std::vector<std::string> robots = robots_of(entries);
  TextTable table{.header = {"metric", "unit"}, .rows = {}, .label_columns = 2};
  if (robots.empty()) return table;
  table.header.insert(table.header.end(), robots.begin(), robots.end());
  const auto add = [&](const std::string& title, const std::string& unit, const std::string& metric) {
    std::vector<std::string> row = {title, unit};
    for (const std::string& robot : robots) {
      const double value = mean_of(entries, robot, metric);
      row.push_back(std::isfinite(value) ? fmt::format("{:.4g}", value) : "-");
    }
    table.rows.push_back(std::move(row));
  };
  for (const MetricInfo& metric : metric_catalogue())
    if (metric.group == MetricGroup::kRetargeting || metric.group == MetricGroup::kGrounding)
      add(std::string(metric.name), std::string(metric.unit), std::string(metric.name));
  add("task detected on the robot", "share of clips", "robot_detected");
  return table;
}

TextTable source_table(std::span<const DatasetEntry> entries) {
  std::map<std::string, std::pair<int, std::string>> formats;
  for (const DatasetEntry& entry : entries) {
    auto& [clips, licence] = formats[entry.format];
    ++clips;
    licence = entry.licence;
  }
  TextTable table{.header = {"format", "clips", "licence of the data set"}, .rows = {}, .label_columns = 1};
  for (const auto& [format, known] : formats)
    table.rows.push_back({format, std::to_string(known.first), known.second.empty() ? "unknown" : known.second});
  return table;
}

}  // namespace duet
