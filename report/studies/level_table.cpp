#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "duet/core/episode_tags.h"
#include "duet/core/require.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/studies/studies.h"

namespace duet {
namespace {

// A ladder and the success that counts as having passed a level of it.
struct Ladder {
  std::string_view word, title;
  double pass;
};
constexpr std::array<Ladder, 2> kLadders = {{
    {"level", "Levels", 0.5},   // of suites for policies
    {"stage", "Stages", 0.95},  // of suites for controllers, as suites/wbc_gates.yaml asks of pushes
}};

struct LevelName {
  int level = 0;
  std::string name;  // "walks_up"
  auto operator<=>(const LevelName&) const = default;
};

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

struct LadderCounts {
  std::map<int, std::string> names;
  std::map<PolicyKey, CountsByLevel> policies;
};

LadderCounts counts_of(const Ladder& ladder, const std::map<PolicyKey, PerturbedRows>& policies) {
  LadderCounts counts;
  for (const auto& [key, perturbed] : policies) {
    for (const auto& [perturbation, episodes] : perturbed) {
      for (const auto& [id, row] : episodes) {
        const std::optional<LevelName> found = level_of_row(ladder.word, *row);
        if (!found) continue;
        add_level_name(ladder, *found, counts.names);
        counts.policies[key][found->level].add(id, passes(*row) ? 1.0 : 0.0);
      }
    }
  }
  return counts;
}

// "level_3_walks_up".
std::string level_key(const Ladder& ladder, int level, const std::string& name) {
  return fmt::format("{}_{}{}{}", ladder.word, level, name.empty() ? "" : "_", name);
}

// Success at each level, 0 episodes where it was not run; its mean over those that were; the last one up to which each
// was passed, absent where not even the first was.
void add_levels(const Ladder& ladder, const std::map<int, std::string>& names, const CountsByLevel& counts,
                double level, EstimatesOf of) {
  std::optional<int> reached;
  bool passed = true;
  std::vector<double> rates;
  for (const auto& [number, name] : names) {
    const auto found = counts.find(number);
    const Rate rate = found == counts.end() ? Rate{} : make_rate(found->second, level);
    of.keys.of = level_key(ladder, number, name);
    of.rate("success", rate);
    passed = passed && rate.n > 0 && rate.rate >= ladder.pass;
    if (passed) reached = number;
    if (rate.n > 0) rates.push_back(rate.rate);
  }
  of.keys.of = ladder.word;
  const auto levels = static_cast<long>(names.size());
  of.add("mean", levels, mean_of(rates));
  if (reached) of.count("reached", levels, *reached);
}

std::string level_title(int level, const std::string& name) {
  std::string words = name;
  std::ranges::replace(words, '_', ' ');
  return words.empty() ? fmt::format("{}", level) : fmt::format("{} {}", level, words);
}

Pivot ladder_pivot(const Ladder& ladder, const std::map<int, std::string>& names, double level) {
  Pivot pivot{.title = std::string(ladder.title), .rows = policy_rows(), .columns = {}};
  for (const auto& [number, name] : names)
    pivot.columns.push_back(
        column(level_title(number, name), {.of = level_key(ladder, number, name), .name = "success"}, as_percent));
  const std::string word(ladder.word);
  pivot.columns.push_back(column("Mean [%]", {.of = word, .name = "mean"}, as_share));
  pivot.columns.push_back(column("Reached", {.of = word, .name = "reached"}, as_count, "none"));
  pivot.notes = {
      fmt::format("Success [%] at each {0}, from easy to hard, with {1:g} % Wilson intervals, by clip where a clip has "
                  "several draws. Mean: over the {0}s, each counting the same. Reached: the last {0} up to which "
                  "success is {2:g} % or more at each.",
                  word, 100.0 * level, 100.0 * ladder.pass)};
  return pivot;
}

}  // namespace

Analysis level_analysis(const std::vector<EpisodeRow>& rows, double level) {
  Analysis analysis{.name = "levels", .title = "Levels", .level = level};
  const std::map<PolicyKey, PerturbedRows> policies = rows_of_policies(rows);
  for (const Ladder& ladder : kLadders) {
    const LadderCounts counts = counts_of(ladder, policies);
    if (counts.names.size() < 2) continue;
    Estimates estimates;
    EstimatesOf{{.of = std::string(ladder.word)}, estimates}.add("pass", {}, ladder.pass);
    for (const auto& [key, by_level] : counts.policies)
      add_levels(ladder, counts.names, by_level, level, estimates_of(key, estimates));
    analysis.tables.push_back(table_of(estimates, ladder_pivot(ladder, counts.names, level)));
    std::ranges::move(estimates, std::back_inserter(analysis.estimates));
  }
  return analysis;
}

}  // namespace duet
