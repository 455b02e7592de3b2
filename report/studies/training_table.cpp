#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/studies/studies.h"
#include "duet/statistics/clustered.h"

namespace duet {
namespace {

// One episode under one perturbation.
using EpisodeKey = std::pair<std::string, EpisodeId>;
using Episodes = std::map<EpisodeKey, const EpisodeRow*>;
// Trainings by the seed's number and text.
using Trainings = std::map<std::pair<unsigned long long, std::string>, Episodes>;

bool is_seed(std::string_view text) {
  constexpr std::size_t kMostDigits = 18;  // kWholeTags
  return !text.empty() && text.size() <= kMostDigits && text.find_first_not_of("0123456789") == std::string_view::npos;
}

std::map<PolicyKey, Trainings> trainings_of(const std::vector<EpisodeRow>& rows) {
  std::map<PolicyKey, Trainings> methods;
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    const RowTags& tags = perturbed.begin()->second.begin()->second->tags;
    const std::string &method = tags.text(kMethodTag), &seed = tags.text(kTrainingSeedTag);
    if (method.empty() || !is_seed(seed) || key.arm != "main") continue;
    PolicyKey of = key;
    of.policy = method;
    Episodes& episodes = methods[of][{std::stoull(seed), seed}];
    if (!episodes.empty())
      throw InputError(
          fmt::format("two policies are the training of '{}' with seed {}, '{}' and '{}': their tags in the "
                      "suite have to differ",
                      method, seed, episodes.begin()->second->policy, key.policy));
    for (const auto& [perturbation, of_it] : perturbed)
      for (const auto& [id, row] : of_it) episodes[{perturbation, id}] = row;
  }
  return methods;
}

// Episodes that all have, in the order of the first.
std::vector<EpisodeKey> in_all(const std::vector<const Trainings*>& methods) {
  const auto everywhere = [&](const EpisodeKey& key) {
    return std::ranges::all_of(methods, [&](const Trainings* trainings) {
      return std::ranges::all_of(*trainings, [&](const auto& training) { return training.second.contains(key); });
    });
  };
  std::vector<EpisodeKey> keys;
  for (const auto& [key, row] : methods.front()->begin()->second)
    if (everywhere(key)) keys.push_back(key);
  return keys;
}

// Success and falls of each training over the episodes that all of them have, and the mean and spread of their success.
void add_method(const Trainings& trainings, double level, EstimatesOf of) {
  const std::vector<EpisodeKey> common = in_all({&trainings});
  const auto n = static_cast<long>(common.size());
  Estimates each;
  std::vector<double> rates;
  for (const auto& [seed, episodes] : trainings) {
    long successes = 0, falls = 0;
    for (const EpisodeKey& key : common) {
      successes += headline_success(*episodes.at(key)) ? 1 : 0;
      falls += episodes.at(key)->fell ? 1 : 0;
    }
    of.keys.of = fmt::format("seed{}", seed.second);
    const EstimatesOf training{of.keys, each};
    training.rate("success", make_rate(successes, n, level));
    rates.push_back(each.back().value);
    training.rate("falls", make_rate(falls, n, level));
  }
  of.keys.of = "";
  of.add("mean_success", n, mean_of(rates));
  of.add("success_sd", static_cast<long>(rates.size()), sample_deviation(rates));
  of.into.insert(of.into.end(), each.begin(), each.end());
}

TrainingOutcomes outcomes_of(const Trainings& trainings, const std::vector<EpisodeKey>& keys) {
  TrainingOutcomes outcomes;
  for (const auto& [seed, episodes] : trainings) {
    std::vector<double>& of_it = outcomes.emplace_back();
    of_it.reserve(keys.size());
    for (const EpisodeKey& key : keys) of_it.push_back(headline_success(*episodes.at(key)) ? 1.0 : 0.0);
  }
  return outcomes;
}

double mean_success(const TrainingOutcomes& outcomes) {
  double sum = 0.0;
  for (const std::vector<double>& training : outcomes)
    for (const double success : training) sum += success;
  return sum / static_cast<double>(outcomes.size() * outcomes.front().size());
}

struct MethodPair {
  PolicyKey key;  // its policy is "dstar vs dp"
  const Trainings& a;
  const Trainings& b;
  double level;
};
constexpr const char* kEpisodes = "all";

// A minus B over these episodes. The difference alone where a method has one training or all episodes are of one clip.
void add_difference(const MethodPair& pair, const std::string& name, const std::vector<EpisodeKey>& keys,
                    Estimates& into) {
  ClipNumbers clips;
  std::vector<int> clip;
  clip.reserve(keys.size());
  for (const auto& [perturbation, id] : keys) clip.push_back(clips.of(id));
  const TrainingOutcomes a = outcomes_of(pair.a, keys), b = outcomes_of(pair.b, keys);
  const double success_a = mean_success(a), success_b = mean_success(b);
  CrossedDifference crossed{.difference = success_a - success_b};
  if (a.size() >= 2 && b.size() >= 2 && clips.size() >= 2) crossed = crossed_difference(a, b, clip, pair.level);
  const auto n = static_cast<long>(keys.size());
  EstimatesOf of = estimates_of(pair.key, into);
  of.keys.of = name;
  of.add("success_a", n, success_a);
  of.add("success_b", n, success_b);
  of.add("difference", n, crossed.difference, crossed.interval);
  of.add("of_trainings", n, crossed.of_trainings);
  of.add("degrees_of_freedom", n, crossed.degrees);
  of.add("p", n, crossed.p);
  of.add("p_holm", n, CrossedDifference::kUnknown);
  of.count("clips", n, static_cast<long>(clips.size()));
  of.word("verdict", "");
}

using Belongs = std::function<bool(const EpisodeKey&)>;

// A part that is empty or the whole is none.
void add_part(const MethodPair& pair, const std::string& name, const std::vector<EpisodeKey>& keys,
              const Belongs& belongs, Estimates& into) {
  std::vector<EpisodeKey> those;
  std::ranges::copy_if(keys, std::back_inserter(those), belongs);
  if (!those.empty() && those.size() < keys.size()) add_difference(pair, name, those, into);
}

// All episodes, recorded and synthetic people; `parts`: tasks and perturbations.
void add_differences(const MethodPair& pair, Estimates& differences, Estimates& parts) {
  const std::vector<EpisodeKey> keys = in_all({&pair.a, &pair.b});
  if (keys.empty()) return;
  add_difference(pair, kEpisodes, keys, differences);
  const Episodes& episodes = pair.a.begin()->second;
  for (const std::string_view people : {kRecordedPeople, kSyntheticPeople})
    add_part(
        pair, std::string(people), keys,
        [&](const EpisodeKey& key) { return episodes.at(key)->tags.text(kPeopleTag) == people; }, differences);
  std::set<std::pair<int, std::string>> tasks;
  std::set<std::string> perturbations;
  for (const auto& [perturbation, id] : keys) {
    tasks.insert({task_rank(id.task), id.task});
    perturbations.insert(perturbation);
  }
  for (const auto& [rank, task] : tasks)
    add_part(
        pair, task, keys, [&task = task](const EpisodeKey& key) { return key.second.task == task; }, parts);
  for (const std::string& perturbation : perturbations)
    add_part(
        pair, perturbation, keys, [&](const EpisodeKey& key) { return key.first == perturbation; }, parts);
}

std::vector<const Estimate*> of_each_seed(const PivotRow& row, std::string_view name) {
  std::vector<const Estimate*> found;
  for (const Estimate* estimate : row.estimates)
    if (estimate->name == name && !estimate->of.empty()) found.push_back(estimate);
  return found;
}

std::string seeds_cell(const PivotRow& row) {
  std::vector<std::string> seeds;
  for (const Estimate* success : of_each_seed(row, "success")) seeds.push_back(success->of.substr(4));
  return fmt::format("{}", fmt::join(seeds, ", "));
}

std::string each_cell(const PivotRow& row) {
  std::vector<std::string> each;
  for (const Estimate* success : of_each_seed(row, "success")) each.push_back(as_share(*success));
  return fmt::format("{}", fmt::join(each, ", "));
}

std::string falls_cell(const PivotRow& row) {
  const std::vector<const Estimate*> falls = of_each_seed(row, "falls");
  double mean = 0.0;
  for (const Estimate* of : falls) mean += of->value / static_cast<double>(falls.size());
  return percent(mean);
}

Pivot method_pivot() {
  return {.title = "Trainings",
          .rows = policy_rows(),
          .columns = {{"Seeds", seeds_cell},
                      column("n of each", {.name = "mean_success"}, as_n),
                      {"Success of each [%]", each_cell},
                      column("Mean [%]", {.name = "mean_success"}, as_share),
                      column("SD [points]", {.name = "success_sd"}, as_share),
                      {"Fell [%]", falls_cell}},
          .notes = {"Policies to which the suite gives one tag `method` are its trainings. n: the episodes that all of "
                    "them have. SD: between trainings."}};
}

std::string of_title(const Estimate& keys) { return keys.of == kEpisodes ? "all episodes" : keys.of; }

TitledTable difference_table(const std::string& title, const Estimates& differences, double level, double margin) {
  TitledTable titled = table_of(
      differences,
      {.title = title,
       .rows = policy_rows({{"Of", &Estimate::of, true, of_title}}),
       .columns = {column("n", {.name = "difference"}, as_n), column("Clips", {.name = "clips"}, as_count),
                   column("A [%]", {.name = "success_a"}, as_share), column("B [%]", {.name = "success_b"}, as_share),
                   column("A - B [points]", {.name = "difference"}, as_points), column("p", {.name = "p"}, as_p),
                   column("p (Holm)", {.name = "p_holm"}, as_p), column("Verdict", {.name = "verdict"}, as_word)}});
  titled.notes = {fmt::format(
      "A, B: mean success of the trainings of the first and of the second method over n episodes that all "
      "of them have. Trainings and clips are random effects: intervals of {0:g} % and p from Student's "
      "distribution with Satterthwaite's degrees of freedom; a clip in both roles is one clip. p (Holm): "
      "corrected for the {1} lines here. Verdict: of A; the same where the interval lies within {2:g} "
      "points, else better or worse where p (Holm) is at most {3:.2g}. Without two trainings of each method "
      "nothing is said.",
      100.0 * level, titled.table.rows.size(), 100.0 * margin, 1.0 - level)};
  return titled;
}

}  // namespace

Analysis training_analysis(const std::vector<EpisodeRow>& rows, double level, double margin) {
  Analysis analysis{.name = "trainings", .title = "Several trainings of one policy", .level = level};
  const std::map<PolicyKey, Trainings> methods = trainings_of(rows);
  Estimates differences, parts;
  for (auto a = methods.begin(); a != methods.end(); ++a) {
    add_method(a->second, level, estimates_of(a->first, analysis.estimates));
    for (auto b = methods.begin(); b != methods.end(); ++b) {
      const bool in_turn = b->first.policy < a->first.policy;  // "dstar vs dp": the later name is A
      if (!in_turn || b->first.engine != a->first.engine || b->first.controller != a->first.controller) continue;
      PolicyKey key = a->first;
      key.policy = fmt::format("{} vs {}", a->first.policy, b->first.policy);
      add_differences({key, a->second, b->second, level}, differences, parts);
    }
  }
  if (analysis.empty()) {
    analysis.notes = {
        "The suite gives no policy the tags `method` and `seed`, which say that it is a training of several."};
    return analysis;
  }
  analysis.tables = {table_of(analysis.estimates, method_pivot())};
  for (const auto& [title, family] :
       {std::pair("Methods over their trainings", &differences), std::pair("Where each wins", &parts)}) {
    if (family->empty()) continue;
    judge_family("difference", level, margin, *family);
    analysis.tables.push_back(difference_table(title, *family, level, margin));
    analysis.estimates.insert(analysis.estimates.end(), family->begin(), family->end());
  }
  return analysis;
}

}  // namespace duet
