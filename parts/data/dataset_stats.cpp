#include "duet/parts/data/dataset_stats.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/core/parallel.h"
#include "duet/core/require.h"
#include "duet/datasets/dataset_folder.h"
#include "duet/datasets/dataset_tables.h"
#include "duet/datasets/interaction_tables.h"
#include "duet/experiment/plan/clips.h"
#include "duet/motion/interaction_clip.h"

namespace duet::cli {
namespace {

std::vector<std::string> files_of(const std::string& folder) {
  try {
    return find_clip_files({folder});
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}; expected a data set of duet or clips (NPZ)", error.what()));
  }
}

// Statistics of the people of a data set, or of the clips in a folder.
InteractionSet interactions_of(const std::string& folder) {
  const std::vector<std::string> files = files_of(folder);
  InteractionSet set{.name = std::filesystem::path(folder).lexically_normal().filename().string(),
                     .tasks = std::vector<Task>(files.size(), Task::kHug),
                     .clips = std::vector<InteractionStatistics>(files.size())};
  parallel_for_each(static_cast<int>(files.size()), default_threads(), [&](int i) {
    const InteractionClip clip = load_clip(files[i]);
    set.tasks[i] = clip.task;
    set.clips[i] = interaction_statistics(clip);
  });
  return set;
}

// Tables of people, one a task; with a second set those of tasks that both have.
void add_interactions(const std::string& folder, const std::string& against, std::string& text, nlohmann::json& json) {
  const InteractionSet set = interactions_of(folder);
  const InteractionSet other = against.empty() ? InteractionSet{} : interactions_of(against);
  for (const Task task : all_tasks()) {
    if (set.of(task).empty() || (!against.empty() && other.of(task).empty())) continue;
    const TextTable table = against.empty() ? interaction_table(set, task) : interaction_table(set, other, task);
    text += markdown_table(table) + "\n";
    nlohmann::json& entry = json["interactions"][std::string(to_string(task))];
    entry = {{"header", table.header}, {"rows", table.rows}};
    if (against.empty()) continue;
    const InteractionAgreement found = interaction_agreement(set, other, task);
    text += fmt::format("{}: {} of {} statistics within {:.0f} %\n\n", to_string(task), found.agreeing, found.compared,
                        100.0 * kAgreement);
    entry["agreeing"] = found.agreeing;
    entry["compared"] = found.compared;
  }
  if (!json.contains("interactions"))
    throw InputError(fmt::format("'{}' and '{}' have no task in common", folder, against));
}

void add_entries(const std::vector<DatasetEntry>& entries, std::string& text, nlohmann::json& json) {
  for (const auto& [name, table] : {std::pair{"tasks", task_table(entries)},
                                    {"outcomes", outcome_table(entries)},
                                    {"curation", curation_table(entries)},
                                    {"retargeting", retargeting_table(entries)}}) {
    if (table.rows.empty()) continue;
    text += markdown_table(table) + "\n";
    json[name] = {{"header", table.header}, {"rows", table.rows}};
  }
}

// Prints the statistics; for a data set its own tables, too, unless it is held against another.
void run_stats(const Session& session, const std::string& folder, const std::string& against) {
  const bool made = is_dataset(folder);
  const std::vector<DatasetEntry> entries =
      made && against.empty() ? read_dataset(folder) : std::vector<DatasetEntry>{};
  std::string text;
  nlohmann::json json = nlohmann::json::object();
  if (!made || !against.empty()) add_interactions(folder, against, text, json);
  if (!entries.empty()) {
    add_entries(entries, text, json);
    if (std::ranges::count(entries, ClipStatus::kKept, &DatasetEntry::status) > 0)
      add_interactions(folder, against, text, json);
  }
  print(session, text, json);
}

}  // namespace

void add_dataset_stats(CLI::App& dataset, Session& session) {
  CLI::App* command = add_command(dataset, session, "stats", "the tables of a data set, and how its people interact",
                                  "duet dataset stats data\n"
                                  "  duet dataset stats clips --against recorded");
  auto folder = std::make_shared<std::string>();
  auto against = std::make_shared<std::string>();
  command->add_option("folder", *folder, "a data set, or a folder of clips of two people")->required();
  command->add_option("--against", *against, "another one, to hold the interactions of the first against");
  command->callback([&session, folder, against] { run_stats(session, *folder, *against); });
}

}  // namespace duet::cli
