#include "duet/datasets/dataset_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "duet/core/file_batch.h"
#include "duet/core/json.h"
#include "duet/datasets/annotations.h"
#include "duet/datasets/dataset_card.h"
#include "duet/datasets/dataset_folder.h"
#include "duet/datasets/dataset_tables.h"

namespace duet {
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
  const auto write = [&](const std::string& name, const std::string& text) { batch.write(inside(folder, name), text); };
  write("manifest.json", manifest_of(entries));
  write("annotations.csv", annotations_of(entries));
  write("tables/curation.csv", csv_table(curation_table(entries)));
  write("tables/tasks.csv", csv_table(task_table(entries)));
  write("tables/outcomes.csv", csv_table(outcome_table(entries)));
  write("tables/refused.csv", csv_table(refused_table(entries)));
  write("tables/retargeting.csv", csv_table(retargeting_table(entries)));
  write("card.md", dataset_card_markdown(entries, settings));
  write("card.html", dataset_card_html(entries, settings));
  batch.put_in_place();
}

}  // namespace duet
