#include "duet/replay/replay_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <tuple>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

bool is_wanted(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::ranges::find(names, name) != names.end();
}

void check_names(const char* kind, const std::vector<std::string>& asked, const std::vector<EpisodeRow>& rows,
                 std::string EpisodeRow::*field) {
  std::set<std::string> known;
  for (const EpisodeRow& row : rows) known.insert(row.*field);
  const std::vector<std::string> list(known.begin(), known.end());
  for (const std::string& name : asked) require(known.contains(name), unknown_name_message(kind, name, list));
}

// The null arm belongs to every policy.
bool fits(const EpisodeRow& row, const ReplayChoice& choice) {
  return is_wanted(choice.engines, row.engine) && is_wanted(choice.controllers, row.controller) &&
         (row.arm == "null" || is_wanted(choice.policies, row.policy)) &&
         is_wanted(choice.perturbations, row.perturbation) && is_wanted(choice.tasks, row.task);
}

bool begins_with_any(const EpisodeRow& row, const std::vector<std::string>& beginnings) {
  const std::string id = scene_id(row);
  return std::ranges::any_of(beginnings, [&](const std::string& beginning) {
    return row.key.starts_with(beginning) || id == beginning || id.starts_with(beginning + "/");
  });
}

// The controller, among those of the rows, with the best mean success in the main arm; of equal ones the first.
std::string best_controller(const std::vector<const EpisodeRow*>& rows) {
  std::map<std::string, std::pair<long, long>> counts;  // successes, all
  for (const EpisodeRow* row : rows) {
    if (row->arm != "main") continue;
    auto& [k, n] = counts[row->controller];
    k += row->success.value_or(false) ? 1 : 0;
    ++n;
  }
  std::string best;
  double rate = -1.0;
  for (const auto& [name, count] : counts) {
    const double own = static_cast<double>(count.first) / static_cast<double>(count.second);
    if (own > rate) std::tie(best, rate) = std::tuple(name, own);
  }
  return best;
}

double disagreement_of(const ChosenScene& scene) {
  int successes = 0, judged = 0;
  for (const EpisodeRow* row : scene.rows) {
    if (row->arm != "main" || !row->success) continue;
    ++judged;
    successes += *row->success ? 1 : 0;
  }
  return judged == 0 ? 0.0 : static_cast<double>(std::min(successes, judged - successes)) / judged;
}

// The main arm before others; then by policy, controller and engine, playback after the engines.
auto track_order(const EpisodeRow* row) {
  const int arm = row->arm == "main" ? 0 : row->arm == "null" ? 2 : 1;
  return std::tuple(arm, row->policy, row->controller, row->engine == kPlaybackEngine, row->engine);
}

std::vector<ChosenScene> scenes_of(const std::vector<const EpisodeRow*>& rows) {
  std::map<std::string, std::vector<const EpisodeRow*>> by_id;
  for (const EpisodeRow* row : rows) by_id[scene_id(*row)].push_back(row);
  std::vector<ChosenScene> scenes;
  for (auto& [id, own] : by_id) {
    std::ranges::sort(own, {}, track_order);
    scenes.push_back({id, std::move(own)});
  }
  std::ranges::stable_sort(scenes, std::greater(), disagreement_of);
  return scenes;
}

// The first `count`: the one of each task with the least agreement, before the second one of any; in the order as
// before.
std::vector<ChosenScene> least_agreeing(std::vector<ChosenScene> scenes, int count) {
  std::map<std::string, int> seen;
  std::map<std::string, int> place;  // of a scene among those of its task
  for (const ChosenScene& scene : scenes) place[scene.id] = seen[scene.rows.front()->task]++;
  std::ranges::stable_sort(scenes, {}, [&](const ChosenScene& scene) { return place[scene.id]; });
  scenes.resize(static_cast<std::size_t>(count));
  std::ranges::stable_sort(scenes, std::greater(), disagreement_of);
  return scenes;
}

}  // namespace

std::string scene_id(const EpisodeRow& row) {
  return fmt::format("{}/{}/{}/{}", row.task, row.clip, row.episode, row.perturbation);
}

ChosenRows chosen_rows(const std::vector<EpisodeRow>& rows, const ReplayChoice& choice) {
  check_names("engine", choice.engines, rows, &EpisodeRow::engine);
  check_names("controller", choice.controllers, rows, &EpisodeRow::controller);
  check_names("policy", choice.policies, rows, &EpisodeRow::policy);
  check_names("perturbation", choice.perturbations, rows, &EpisodeRow::perturbation);
  check_names("task", choice.tasks, rows, &EpisodeRow::task);
  std::vector<const EpisodeRow*> fitting;
  for (const EpisodeRow& row : rows)
    if (fits(row, choice) && (choice.episodes.empty() || begins_with_any(row, choice.episodes)))
      fitting.push_back(&row);
  for (const std::string& beginning : choice.episodes)
    require(std::ranges::any_of(fitting, [&](const EpisodeRow* row) { return begins_with_any(*row, {beginning}); }),
            "no episode begins with '{}': expected the beginning of a key, or task/clip/episode", beginning);
  ChosenRows chosen;
  std::set<std::string> controllers;
  for (const EpisodeRow* row : fitting) controllers.insert(row->controller);
  if (choice.controllers.empty() && choice.episodes.empty() && controllers.size() > 1) {
    const std::string best = best_controller(fitting);
    std::erase_if(fitting, [&](const EpisodeRow* row) { return row->controller != best; });
    chosen.notes.push_back(
        fmt::format("Controller {} alone, the one with the best mean success; --controllers shows others.", best));
  }
  require(!fitting.empty(), "no episode of the run is what --engines, --controllers, --policies, --tasks ask for");
  chosen.scenes = scenes_of(fitting);
  const auto all = static_cast<int>(chosen.scenes.size());
  if (choice.episodes.empty() && all > choice.scenes) {
    chosen.scenes = least_agreeing(std::move(chosen.scenes), choice.scenes);
    chosen.notes.push_back(fmt::format(
        "The {} of {} clips on which the tracks agree least, of different tasks first; --scenes shows more.",
        choice.scenes, all));
  }
  return chosen;
}

}  // namespace duet
