#include "duet/report/studies/level_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "duet/core/episode_tags.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using CountsByLevel = std::map<int, SuccessByClip>;

// The headline; a robot that a commanded velocity leads has to follow it by half, so that standing is no walking.
bool passes(const EpisodeRow& row) {
  const auto metric = [&](const char* name) {
    const auto found = row.metrics.find(name);
    return found == row.metrics.end() ? 0.0 : found->second;
  };
  const double command = metric("command_forward");
  return headline_success(row) && (command <= 0.0 || metric("speed_forward") >= 0.5 * command);
}

// The tag of the row's perturbation or clip.
std::optional<LevelName> level_of(std::string_view word, std::string_view part, const EpisodeRow& row) {
  const double level = row.tags.number(row_tag(part, word));
  constexpr double kHighest = 999'999.0;  // kWholeTags
  if (!(level >= 0.0 && level <= kHighest) || level != std::floor(level)) return std::nullopt;
  return LevelName{static_cast<int>(level), row.tags.text(row_tag(part, std::string(word) + "_name"))};
}

// The level of its perturbation or of its clip, whichever is higher.
std::optional<LevelName> level_of_row(std::string_view word, const EpisodeRow& row) {
  const std::optional<LevelName> perturbed = level_of(word, kOfPerturbation, row), clip = level_of(word, kOfClip, row);
  if (perturbed && clip) return std::max(*perturbed, *clip);
  if (perturbed || (clip && row.perturbation == kClean)) return perturbed ? perturbed : clip;
  return row.perturbation == kClean ? std::optional(LevelName{0, std::string(kClean)}) : std::nullopt;
}

void add_level_name(const Ladder& ladder, const LevelName& found, std::map<int, std::string>& names) {
  const auto [known, is_new] = names.emplace(found.level, found.name);
  if (!is_new && known->second != found.name)
    throw InputError(
        fmt::format("two names of {} {}: '{}' and '{}'", ladder.word, found.level, known->second, found.name));
}

LevelEntry level_entry(const PolicyKey& key, const CountsByLevel& counts, const LevelTable& table) {
  LevelEntry entry{.key = key, .levels = {}, .reached = {}};
  bool passed = true;
  int run = 0;
  for (const LevelName& name : table.levels) {
    const auto found = counts.find(name.level);
    const Rate rate = found == counts.end() ? Rate{} : make_rate(found->second, table.level);
    entry.levels.push_back(rate);
    passed = passed && rate.n > 0 && rate.rate >= table.ladder.pass;
    if (passed) entry.reached = name.level;
    if (rate.n == 0) continue;
    entry.mean += rate.rate;
    ++run;
  }
  entry.mean /= run;
  return entry;
}

LevelTable ladder_table(const Ladder& ladder, const std::map<PolicyKey, PerturbedRows>& policies, double level) {
  LevelTable table{.ladder = ladder, .level = level, .levels = {}, .entries = {}};
  std::map<int, std::string> names;
  std::map<PolicyKey, CountsByLevel> counts;
  for (const auto& [key, perturbed] : policies) {
    for (const auto& [perturbation, episodes] : perturbed) {
      for (const auto& [id, row] : episodes) {
        const std::optional<LevelName> found = level_of_row(ladder.word, *row);
        if (!found) continue;
        add_level_name(ladder, *found, names);
        counts[key][found->level].add(id, passes(*row) ? 1.0 : 0.0);
      }
    }
  }
  for (const auto& [number, name] : names) table.levels.push_back({number, name});
  for (const auto& [key, by_level] : counts) table.entries.push_back(level_entry(key, by_level, table));
  return table;
}

std::string level_title(const LevelName& level) {
  std::string words = level.name;
  std::ranges::replace(words, '_', ' ');
  return words.empty() ? fmt::format("{}", level.level) : fmt::format("{} {}", level.level, words);
}

TitledTable titled_ladder(const LevelTable& table) {
  TitledTable titled = labelled_table(std::string(table.ladder.title), labels_of(table.entries));
  for (const LevelName& level : table.levels) titled.table.header.push_back(level_title(level));
  titled.table.header.insert(titled.table.header.end(), {"Mean [%]", "Reached"});
  for (std::size_t i = 0; i < table.entries.size(); ++i) {
    const LevelEntry& entry = table.entries[i];
    std::vector<std::string>& cells = titled.table.rows[i];
    for (const Rate& rate : entry.levels) cells.push_back(rate_cell(rate));
    cells.push_back(percent(entry.mean));
    cells.push_back(entry.reached ? count_cell(*entry.reached) : "none");
  }
  titled.notes = {
      fmt::format("Success [%] at each {0}, from easy to hard, with {1:g} % Wilson intervals, by clip where a clip has "
                  "several draws. Mean: over the {0}s, each counting the same. Reached: the last {0} up to which "
                  "success is {2:g} % or more at each.",
                  table.ladder.word, 100.0 * table.level, 100.0 * table.ladder.pass)};
  return titled;
}

// "level_3_walks_up".
std::string level_key(const Ladder& ladder, const LevelName& level) {
  return fmt::format("{}_{}{}{}", ladder.word, level.level, level.name.empty() ? "" : "_", level.name);
}

void add_level_figures(const LevelTable& table, std::vector<Figure>& into) {
  FiguresOf{{.of = std::string(table.ladder.word)}, into}.add("pass", {}, table.ladder.pass);
  for (const LevelEntry& entry : table.entries) {
    FiguresOf figures = figures_of(entry.key, into);
    for (std::size_t i = 0; i < entry.levels.size(); ++i) {
      figures.keys.of = level_key(table.ladder, table.levels[i]);
      figures.rate("success", entry.levels[i]);
    }
    figures.keys.of = table.ladder.word;
    const auto levels = static_cast<long>(entry.levels.size());
    figures.add("mean", levels, entry.mean);
    if (entry.reached) figures.count("reached", levels, *entry.reached);
  }
}

}  // namespace

std::vector<LevelTable> level_tables(const std::vector<EpisodeRow>& rows, double level) {
  const std::map<PolicyKey, PerturbedRows> policies = rows_of_policies(rows);
  std::vector<LevelTable> tables;
  for (const Ladder& ladder : kLadders) {
    LevelTable table = ladder_table(ladder, policies, level);
    if (table.levels.size() > 1) tables.push_back(std::move(table));
  }
  return tables;
}

Analysis level_analysis(const std::vector<LevelTable>& tables) {
  Analysis analysis{.name = "levels", .title = "Levels"};
  for (const LevelTable& table : tables) {
    analysis.level = table.level;
    analysis.tables.push_back(titled_ladder(table));
    add_level_figures(table, analysis.figures);
  }
  return analysis;
}

}  // namespace duet
