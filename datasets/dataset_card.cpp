#include "duet/datasets/dataset_card.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>

#include "duet/core/file_batch.h"
#include "duet/core/json.h"
#include "duet/core/task.h"
#include "duet/datasets/annotations.h"
#include "duet/datasets/curation.h"
#include "duet/datasets/entry.h"
#include "duet/metrics/catalogue.h"
#include "duet/report/tables/line_plot.h"

namespace duet {
namespace {

constexpr std::size_t kPictures = 24;  // a card is read, not searched: the table has them all

struct Section {
  std::string title, text;  // one paragraph, may be empty
  TextTable table;          // without rows: none
  std::string code = {};    // may be empty
};

long kept(std::span<const DatasetEntry> entries) {
  return std::ranges::count_if(entries, [](const DatasetEntry& e) { return e.status == ClipStatus::kKept; });
}

double hours(std::span<const DatasetEntry> entries) {
  double seconds = 0.0;
  for (const DatasetEntry& entry : entries)
    if (entry.status == ClipStatus::kKept) seconds += entry.statistics.seconds;
  return seconds / 3600.0;
}

std::string robots_text(const nlohmann::json& settings) {
  std::string text;
  if (settings.contains("robots"))
    for (const auto& [name, digest] : settings["robots"].items()) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none (people only)" : text;
}

long with_provenance(std::span<const DatasetEntry> entries, const std::string& key, const std::string& value) {
  return std::ranges::count_if(entries, [&](const DatasetEntry& entry) {
    const auto found = entry.provenance.find(key);
    return entry.status == ClipStatus::kKept && found != entry.provenance.end() && found->second == value;
  });
}

std::string cautions(std::span<const DatasetEntry> entries) {
  std::string text = fmt::format(
      "Phases were proposed for {} clips and annotated by a person for {}; annotations.csv holds them all and can be "
      "edited. The task was found by the detectors in {} clips that carry no label.",
      with_provenance(entries, "phases", "proposed"), with_provenance(entries, "phases", "annotated"),
      with_provenance(entries, "task", "detected"));
  const long estimated = with_provenance(entries, "provenance", "estimated shared frame");
  if (estimated > 0)
    text += fmt::format(" In {} clips the two people were recorded apart and their common frame is an estimate.",
                        estimated);
  return text + " The data stay under the licences of the sources above.";
}

std::string loading(const nlohmann::json& settings) {
  std::string robot = "g1";
  if (settings.contains("robots") && !settings["robots"].empty()) robot = settings["robots"].items().begin().key();
  return fmt::format(
      "import json, numpy as np\n"
      "for entry in json.load(open('manifest.json')):\n"
      "    if entry['status'] == 'kept':\n"
      "        clip = np.load(f\"{}/{{entry['clip']}}.npz\")  # keys: docs/file-formats.md\n",
      robot);
}

std::vector<Section> sections(std::span<const DatasetEntry> entries, const nlohmann::json& settings) {
  const TextTable made_up = made_up_table(entries);
  const char* const made_up_text =
      made_up.rows.empty() ? ""
                           : "What the recordings lack: frames of joints that were not seen (gaps), legs below upper "
                             "bodies, a partner who stands still, frames between those of a low or uneven rate.";
  return {{"Sources", "", source_table(entries)},
          {"Clips by task", "50 Hz, z up, metres, floor at 0.", task_table(entries)},
          {"Curation",
           "What came of each recording. A clip is kept where all four gates pass it; one may be refused by several.",
           outcome_table(entries)},
          {"Made up", made_up_text, made_up},
          {"Before and after curation", "Means over clips, weighted by their length.", curation_table(entries)},
          {"Retargeting", "Means over the clips kept.", retargeting_table(entries)},
          {"Loading it", "", {}, loading(settings)},
          {"With care", cautions(entries), {}},
          {"Recordings that are not in it", "", refused_table(entries)}};
}

std::string headline(std::span<const DatasetEntry> entries, const nlohmann::json& settings) {
  return fmt::format("{} of {} recordings of two people, {:.2f} hours; robots: {}. Made by duet {}.", kept(entries),
                     entries.size(), hours(entries), robots_text(settings), settings.value("duet", "?"));
}

std::string html_table(const TextTable& table) {
  std::string html = "<table><thead><tr>";
  for (const std::string& cell : table.header) html += "<th>" + escape_html(cell) + "</th>";
  html += "</tr></thead><tbody>";
  for (const auto& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i)
      html += fmt::format("<td{}>{}</td>", i < table.label_columns ? "" : " class=\"n\"", escape_html(row[i]));
    html += "</tr>";
  }
  return html + "</tbody></table>";
}

std::string pictures(std::span<const DatasetEntry> entries) {
  std::string html;
  std::size_t count = 0;
  for (const DatasetEntry& entry : entries) {
    for (const NamedDigest& output : entry.outputs) {
      if (!output.file.ends_with(".svg") || count == kPictures) continue;
      ++count;
      html += fmt::format("<figure><img src=\"{}\" alt=\"\"><figcaption><b>{}</b> {}</figcaption></figure>",
                          escape_html(output.file), escape_html(entry.clip),
                          escape_html(entry.reasons.empty() ? "" : entry.reasons.front()));
    }
  }
  return html.empty() ? "" : "<div class=\"pictures\">" + html + "</div>";
}

constexpr std::string_view kCardStyle =
    "body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#222}"
    "table{border-collapse:collapse;margin:.5rem 0 1.5rem}th,td{padding:.2rem .7rem;border-bottom:1px solid #ddd;"
    "text-align:left;vertical-align:top}td.n{text-align:right;font-variant-numeric:tabular-nums}"
    "pre{background:#f4f4f4;padding:.8rem;overflow:auto}.pictures{display:grid;gap:1rem;"
    "grid-template-columns:repeat(auto-fill,minmax(20rem,1fr))}figure{margin:0}img{width:100%;background:#fafafa}";

}  // namespace

std::string dataset_card_markdown(std::span<const DatasetEntry> entries, const nlohmann::json& settings) {
  std::string text = "# Data set\n\n" + headline(entries, settings) + "\n";
  for (const Section& section : sections(entries, settings)) {
    if (section.text.empty() && section.table.rows.empty() && section.code.empty()) continue;
    text += "\n## " + section.title + "\n\n";
    if (!section.text.empty()) text += section.text + "\n";
    if (!section.table.rows.empty()) text += "\n" + markdown_table(section.table);
    if (!section.code.empty()) text += "```python\n" + section.code + "```\n";
  }
  return text;
}

std::string dataset_card_html(std::span<const DatasetEntry> entries, const nlohmann::json& settings) {
  std::string html = fmt::format(
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Data set</title><style>{}</style></head>"
      "<body><h1>Data set</h1><p>{}</p>",
      kCardStyle, escape_html(headline(entries, settings)));
  for (const Section& section : sections(entries, settings)) {
    if (section.text.empty() && section.table.rows.empty() && section.code.empty()) continue;
    html += "<h2>" + escape_html(section.title) + "</h2>";
    if (!section.text.empty()) html += "<p>" + escape_html(section.text) + "</p>";
    if (!section.table.rows.empty()) html += html_table(section.table);
    if (!section.code.empty()) html += "<pre>" + escape_html(section.code) + "</pre>";
  }
  return html + pictures(entries) + "</body></html>\n";
}

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

TextTable made_up_table(std::span<const DatasetEntry> entries) {
  std::map<std::string, std::vector<double>> shares;
  for (const DatasetEntry& entry : entries)
    for (const auto& [kind, share] : entry.made_up)
      if (entry.status == ClipStatus::kKept) shares[kind].push_back(share);
  TextTable table{.header = {"made up", "clips", "of the clips", "frames of these"}, .rows = {}, .label_columns = 1};
  for (const auto& [kind, of_clips] : shares) {
    const auto clips = static_cast<double>(of_clips.size());
    table.rows.push_back({kind, std::to_string(of_clips.size()),
                          fmt::format("{:.1f} %", 100.0 * clips / static_cast<double>(kept(entries))),
                          fmt::format("{:.1f} %", 100.0 * std::reduce(of_clips.begin(), of_clips.end()) / clips)});
  }
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

namespace {

std::string manifest_of(const std::vector<DatasetEntry>& entries) {
  std::string text = "[";
  for (const DatasetEntry& entry : entries) text += (text.size() == 1 ? "\n" : ",\n") + entry_line(entry);
  return text + "\n]\n";
}

std::string annotations_of(const std::vector<DatasetEntry>& entries) {
  std::vector<Annotation> annotations;
  for (const DatasetEntry& entry : entries) {
    if (entry.status == ClipStatus::kOther) {  // a person gives it a task here
      annotations.push_back({.clip = entry.clip, .note = fmt::format("label '{}'", entry.label)});
      continue;
    }
    if (entry.task.empty()) continue;
    const auto phases = entry.provenance.find("phases");
    annotations.push_back({.clip = entry.clip,
                           .task = parse_task(entry.task),
                           .reactor = entry.reactor == "A" ? Person::kA : Person::kB,
                           .act_begin = entry.act_begin,
                           .act_end = entry.act_end,
                           .note = phases == entry.provenance.end() ? "" : phases->second});
  }
  return annotations_csv(annotations);
}

}  // namespace

std::string people_file(const std::string& clip) { return "people/" + clip + ".npz"; }
std::string robot_file(const std::string& robot, const std::string& clip) { return robot + "/" + clip + ".npz"; }
std::string rejected_file(const std::string& clip) { return "rejected/" + clip + ".svg"; }

void write_derived_files(const std::string& folder, const std::vector<DatasetEntry>& entries) {
  const nlohmann::json settings = read_dataset_settings(folder);
  FileBatch batch;
  const auto write = [&](const std::string& name, const std::string& text) {
    batch.write(join_without_links(folder, name), text);
  };
  write("manifest.json", manifest_of(entries));
  write("annotations.csv", annotations_of(entries));
  write("tables/curation.csv", csv_table(curation_table(entries)));
  write("tables/tasks.csv", csv_table(task_table(entries)));
  write("tables/outcomes.csv", csv_table(outcome_table(entries)));
  write("tables/refused.csv", csv_table(refused_table(entries)));
  write("tables/retargeting.csv", csv_table(retargeting_table(entries)));
  if (const TextTable made_up = made_up_table(entries); !made_up.rows.empty())
    write("tables/made_up.csv", csv_table(made_up));
  write("card.md", dataset_card_markdown(entries, settings));
  write("card.html", dataset_card_html(entries, settings));
  batch.put_in_place();
}

}  // namespace duet
