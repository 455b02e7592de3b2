#include "duet/report/studies/training_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <tuple>

#include "duet/core/episode_tags.h"
#include "duet/core/require.h"
#include "duet/report/ranking/resolution.h"
#include "duet/report/tables/cells.h"

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

MethodTrainings method_of(const PolicyKey& key, const Trainings& trainings, double level) {
  MethodTrainings method{.key = key};
  const std::vector<EpisodeKey> common = in_all({&trainings});
  std::vector<double> rates;
  for (const auto& [seed, episodes] : trainings) {
    long successes = 0, falls = 0;
    for (const EpisodeKey& each : common) {
      const EpisodeRow& row = *episodes.at(each);
      successes += headline_success(row) ? 1 : 0;
      falls += row.fell ? 1 : 0;
    }
    const auto n = static_cast<long>(common.size());
    method.seeds.push_back(seed.second);
    method.success.push_back(make_rate(successes, n, level));
    method.falls.push_back(make_rate(falls, n, level));
    rates.push_back(method.success.back().rate);
  }
  method.mean = mean_of(rates);
  method.deviation = sample_deviation(rates);
  return method;
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

struct Pair {
  PolicyKey key;
  const Trainings& a;
  const Trainings& b;
  double level;
};

MethodDifference difference_of(const Pair& pair, const std::string& of, const std::vector<EpisodeKey>& keys) {
  MethodDifference result{.key = pair.key, .of = of, .episodes = static_cast<long>(keys.size())};
  ClipNumbers clips;
  std::vector<int> clip;
  clip.reserve(keys.size());
  for (const auto& [perturbation, id] : keys) clip.push_back(clips.of(id));
  const TrainingOutcomes a = outcomes_of(pair.a, keys), b = outcomes_of(pair.b, keys);
  result.clips = static_cast<long>(clips.size());
  result.success_a = mean_success(a);
  result.success_b = mean_success(b);
  result.crossed.difference = result.success_a - result.success_b;
  if (a.size() >= 2 && b.size() >= 2 && clips.size() >= 2) result.crossed = crossed_difference(a, b, clip, pair.level);
  return result;
}

using Belongs = std::function<bool(const EpisodeKey&)>;

std::vector<EpisodeKey> chosen(const std::vector<EpisodeKey>& keys, const Belongs& belongs) {
  std::vector<EpisodeKey> those;
  std::ranges::copy_if(keys, std::back_inserter(those), belongs);
  return those;
}

// A part that is empty or the whole is none.
void add_part(const Pair& pair, const std::string& of, const std::vector<EpisodeKey>& keys, const Belongs& belongs,
              std::vector<MethodDifference>& into) {
  const std::vector<EpisodeKey> those = chosen(keys, belongs);
  if (those.empty() || those.size() == keys.size()) return;
  into.push_back(difference_of(pair, of, those));
}

void add_differences(const Pair& pair, TrainingTable& table) {
  const std::vector<EpisodeKey> keys = in_all({&pair.a, &pair.b});
  if (keys.empty()) return;
  table.differences.push_back(difference_of(pair, std::string(kEpisodes), keys));
  const Episodes& episodes = pair.a.begin()->second;
  for (const std::string_view people : {kRecordedPeople, kSyntheticPeople})
    add_part(
        pair, std::string(people), keys,
        [&](const EpisodeKey& key) { return episodes.at(key)->tags.text(kPeopleTag) == people; }, table.differences);
  std::set<std::pair<int, std::string>> tasks;
  std::set<std::string> perturbations;
  for (const auto& [perturbation, id] : keys) {
    tasks.insert({task_rank(id.task), id.task});
    perturbations.insert(perturbation);
  }
  for (const auto& ranked : tasks)
    add_part(
        pair, ranked.second, keys, [&](const EpisodeKey& key) { return key.second.task == ranked.second; },
        table.parts);
  for (const std::string& perturbation : perturbations)
    add_part(
        pair, perturbation, keys, [&](const EpisodeKey& key) { return key.first == perturbation; }, table.parts);
}

// Holm over those that have a p.
void judge(std::vector<MethodDifference>& differences, double level, double margin) {
  std::vector<double> p_values;
  for (const MethodDifference& each : differences)
    if (!std::isnan(each.crossed.p)) p_values.push_back(each.crossed.p);
  const std::vector<double> adjusted = holm(p_values);
  std::size_t next = 0;
  for (MethodDifference& each : differences) {
    if (std::isnan(each.crossed.p)) continue;
    each.p_holm = adjusted[next++];
    each.verdict = verdict_of(each.crossed.difference, each.crossed.interval, each.p_holm, level, margin);
  }
}

TitledTable method_rows(const TrainingTable& table) {
  TitledTable titled = labelled_table("Trainings", labels_of(table.methods));
  titled.table.header.insert(titled.table.header.end(),
                             {"Seeds", "n of each", "Success of each [%]", "Mean [%]", "SD [points]", "Fell [%]"});
  for (std::size_t i = 0; i < table.methods.size(); ++i) {
    const MethodTrainings& method = table.methods[i];
    std::vector<std::string> each;
    double falls = 0.0;
    for (std::size_t k = 0; k < method.seeds.size(); ++k) {
      each.push_back(percent(method.success[k].rate));
      falls += method.falls[k].rate / static_cast<double>(method.seeds.size());
    }
    std::vector<std::string>& cells = titled.table.rows[i];
    for (std::string cell :
         {fmt::format("{}", fmt::join(method.seeds, ", ")), count_cell(method.success.front().n),
          fmt::format("{}", fmt::join(each, ", ")), percent(method.mean), percent(method.deviation), percent(falls)})
      cells.push_back(std::move(cell));
  }
  titled.notes = {
      "Policies to which the suite gives one tag `method` are its trainings. n: the episodes that all of them have. "
      "SD: between trainings."};
  return titled;
}

std::string of_cell(const std::string& of) { return of == kEpisodes ? "all episodes" : of; }

TitledTable difference_rows(const std::string& title, const std::vector<MethodDifference>& differences,
                            const TrainingTable& table) {
  TitledTable titled = labelled_table(title, labels_of(differences));
  titled.table.header.insert(titled.table.header.end(),
                             {"Of", "n", "Clips", "A [%]", "B [%]", "A - B [points]", "p", "p (Holm)", "Verdict"});
  ++titled.table.label_columns;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    const MethodDifference& each = differences[i];
    std::vector<std::string>& cells = titled.table.rows[i];
    for (std::string cell :
         {of_cell(each.of), count_cell(each.episodes), count_cell(each.clips), percent(each.success_a),
          percent(each.success_b), points(each.crossed.difference, each.crossed.interval), p_cell(each.crossed.p),
          p_cell(each.p_holm), std::string(to_string(each.verdict))})
      cells.push_back(std::move(cell));
  }
  titled.notes = {
      fmt::format("A, B: mean success of the trainings of the first and of the second method over n episodes that all "
                  "of them have. "
                  "Trainings and clips are random effects: intervals of {0:g} % and p from Student's distribution with "
                  "Satterthwaite's degrees of freedom; a clip in both roles is one clip. p (Holm): corrected for the "
                  "{1} lines here. Verdict: of A; the "
                  "same where the "
                  "interval lies within {2:g} points, else better or worse where p (Holm) is at most {3:.2g}. Without "
                  "two trainings "
                  "of each method nothing is said.",
                  100.0 * table.level, differences.size(), 100.0 * table.margin, 1.0 - table.level)};
  return titled;
}

void add_method_figures(const MethodTrainings& method, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(method.key, into);
  figures.add("mean_success", method.success.front().n, method.mean);
  figures.add("success_sd", static_cast<long>(method.seeds.size()), method.deviation);
  for (std::size_t i = 0; i < method.seeds.size(); ++i) {
    figures.keys.of = fmt::format("seed{}", method.seeds[i]);
    figures.rate("success", method.success[i]);
    figures.rate("falls", method.falls[i]);
  }
}

void add_difference_figures(const MethodDifference& each, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(each.key, into);
  figures.keys.of = each.of;
  figures.add("success_a", each.episodes, each.success_a);
  figures.add("success_b", each.episodes, each.success_b);
  figures.add("difference", each.episodes, each.crossed.difference, each.crossed.interval);
  figures.add("of_trainings", each.episodes, each.crossed.of_trainings);
  figures.add("degrees_of_freedom", each.episodes, each.crossed.degrees);
  figures.add("p", each.episodes, each.crossed.p);
  figures.add("p_holm", each.episodes, each.p_holm);
  figures.count("clips", each.episodes, each.clips);
  figures.word("verdict", std::string(to_string(each.verdict)));
}

}  // namespace

TrainingTable training_table(const std::vector<EpisodeRow>& rows, double level, double margin) {
  TrainingTable table{.level = level, .margin = margin, .methods = {}, .differences = {}, .parts = {}};
  const std::map<PolicyKey, Trainings> methods = trainings_of(rows);
  for (auto a = methods.begin(); a != methods.end(); ++a) {
    table.methods.push_back(method_of(a->first, a->second, level));
    for (auto b = methods.begin(); b != methods.end(); ++b) {
      const bool in_turn = b->first.policy < a->first.policy;  // "dstar vs dp": the later name is A
      if (!in_turn || b->first.engine != a->first.engine || b->first.controller != a->first.controller) continue;
      PolicyKey key = a->first;
      key.policy = fmt::format("{} vs {}", a->first.policy, b->first.policy);
      add_differences({key, a->second, b->second, level}, table);
    }
  }
  judge(table.differences, level, margin);
  judge(table.parts, level, margin);
  return table;
}

Analysis training_analysis(const TrainingTable& table) {
  Analysis analysis{.name = "trainings", .title = "Several trainings of one policy", .level = table.level};
  if (table.methods.empty()) {
    analysis.notes = {
        "The suite gives no policy the tags `method` and `seed`, which say that it is a training of several."};
    return analysis;
  }
  analysis.tables = {method_rows(table)};
  if (!table.differences.empty())
    analysis.tables.push_back(difference_rows("Methods over their trainings", table.differences, table));
  if (!table.parts.empty()) analysis.tables.push_back(difference_rows("Where each wins", table.parts, table));
  for (const MethodTrainings& method : table.methods) add_method_figures(method, analysis.figures);
  for (const std::vector<MethodDifference>* list : {&table.differences, &table.parts})
    for (const MethodDifference& each : *list) add_difference_figures(each, analysis.figures);
  return analysis;
}

}  // namespace duet
