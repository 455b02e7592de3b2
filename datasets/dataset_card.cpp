#include "duet/datasets/dataset_card.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "duet/datasets/dataset_tables.h"
#include "duet/report/tables/escape_html.h"

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
  return {{"Sources", "", source_table(entries)},
          {"Clips by task", "50 Hz, z up, metres, floor at 0.", task_table(entries)},
          {"Curation",
           "What came of each recording. A clip is kept where all four gates pass it; one may be refused by several.",
           outcome_table(entries)},
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

}  // namespace duet
