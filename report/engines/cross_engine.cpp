// Rows by engine, success per engine and the stability of ranks.
#include "duet/report/engines/cross_engine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "duet/core/require.h"
#include "duet/report/engines/cross_engine_parts.h"
#include "duet/rows/groups/distinct_episodes.h"

namespace duet {
namespace {

constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();

std::set<std::string> engines_of(const EpisodesOfEngines& episodes) {
  std::set<std::string> engines;
  for (const auto& [id, row_of] : episodes) {
    for (const auto& [engine, row] : row_of) engines.insert(engine);
  }
  return engines;
}

// The success rate in one engine; with no episode the rate is not defined, and its interval is all of [0, 1].
EngineRate engine_rate(const std::string& engine, const SuccessByClip& success, double level) {
  if (success.episodes() == 0) return {engine, 0, 0, kUndefined, wilson(0, 0, level)};
  return {engine, success.episodes(), success.successes(), success.mean(), success.of_episodes(level)};
}

// The episodes of one combination, gathered before its statistics are computed.
struct Gathered {
  std::map<std::string, SuccessByClip> engines;
  SuccessByClip playback;
  SuccessByClip means;  // over engines, per episode
};

void gather_episode(const EpisodeId& id, const RowPerEngine& row_of, const EpisodeRow* playback, Gathered& gathered) {
  const auto success_of = [](const EpisodeRow& row) { return headline_success(row) ? 1.0 : 0.0; };
  std::vector<double> successes;
  for (const auto& [engine, row] : row_of) {
    successes.push_back(success_of(*row));
    gathered.engines.at(engine).add(id, successes.back());
  }
  gathered.means.add(id, mean_of(successes));
  if (playback != nullptr) gathered.playback.add(id, success_of(*playback));
}

void add_spread(EngineSuccess& success) {
  std::vector<double> rates;
  std::vector<double> variances;
  for (const EngineRate& rate : success.engines) {
    rates.push_back(rate.rate);
    variances.push_back(success.n > 1 ? rate.rate * (1.0 - rate.rate) / static_cast<double>(success.n - 1)
                                      : kUndefined);
  }
  const auto [lowest, highest] = std::minmax_element(rates.begin(), rates.end());
  success.mean = mean_of(rates);
  success.range = *highest - *lowest;
  success.sd = sample_deviation(rates);
  success.noise_sd = std::sqrt(mean_of(variances));
  const double excess = success.sd * success.sd - mean_of(variances);
  success.excess_sd = std::isfinite(excess) ? std::sqrt(std::max(excess, 0.0)) : kUndefined;
}

EngineSuccess success_of(const Combination& combination, const EpisodesOfEngines& episodes, const EngineRows& rows,
                         double level) {
  EngineSuccess success;
  success.controller = combination.controller;
  success.policy = combination.policy;
  success.perturbation = combination.perturbation;
  Gathered gathered;
  for (const std::string& engine : engines_of(episodes)) gathered.engines[engine];
  for (const auto& [id, row_of] : episodes) {
    if (row_of.size() < gathered.engines.size()) {
      ++success.left_out;
      continue;
    }
    gather_episode(id, row_of, rows.playback(combination, id), gathered);
    ++success.n;
  }
  for (const auto& [engine, of] : gathered.engines) success.engines.push_back(engine_rate(engine, of, level));
  if (gathered.playback.episodes() > 0)
    success.playback = engine_rate(std::string(kPlaybackEngine), gathered.playback, level);
  add_spread(success);
  success.mean_interval = success.n > 0 ? gathered.means.by_clip(level) : kNoInterval;
  return success;
}

using Item = std::pair<std::string, std::string>;

// Items with their mean success in two engines.
struct ItemRates {
  std::vector<Item> items;
  std::vector<double> in_a, in_b;
};

const EngineRate* rate_in(const EngineSuccess& success, const std::string& engine) {
  for (const EngineRate& rate : success.engines) {
    if (rate.engine == engine && rate.n > 0) return &rate;
  }
  return nullptr;
}

template <typename ItemOf>
ItemRates item_rates(const std::vector<EngineSuccess>& success, const std::string& a, const std::string& b,
                     ItemOf item_of) {
  std::map<Item, std::pair<std::vector<double>, std::vector<double>>> rates;
  for (const EngineSuccess& entry : success) {
    const EngineRate* in_a = rate_in(entry, a);
    const EngineRate* in_b = rate_in(entry, b);
    if (in_a == nullptr || in_b == nullptr) continue;
    auto& [of_a, of_b] = rates[item_of(entry)];
    of_a.push_back(in_a->rate);
    of_b.push_back(in_b->rate);
  }
  ItemRates result;
  for (const auto& [item, values] : rates) {
    result.items.push_back(item);
    result.in_a.push_back(mean_of(values.first));
    result.in_b.push_back(mean_of(values.second));
  }
  return result;
}

using ItemPairs = std::set<std::pair<Item, Item>>;

// Collects all pairs of items, and those in opposite order in the two engines.
void collect_pairs(const ItemRates& rates, ItemPairs& all, ItemPairs& swapped) {
  for (std::size_t i = 0; i < rates.items.size(); ++i) {
    for (std::size_t j = i + 1; j < rates.items.size(); ++j) {
      const std::pair<Item, Item> pair = {rates.items[i], rates.items[j]};
      const std::vector<double> a = {rates.in_a[i], rates.in_a[j]};
      const std::vector<double> b = {rates.in_b[i], rates.in_b[j]};
      all.insert(pair);
      if (kendall(a, b).discordant > 0) swapped.insert(pair);
    }
  }
}

template <typename ItemOf>
RankStability stability_of(const char* of, const std::vector<EngineSuccess>& success, ItemOf item_of) {
  std::set<std::string> engines;
  std::set<Item> items;
  for (const EngineSuccess& entry : success) {
    items.insert(item_of(entry));
    for (const EngineRate& rate : entry.engines) engines.insert(rate.engine);
  }
  RankStability stability;
  stability.of = of;
  stability.items = static_cast<long>(items.size());
  ItemPairs all;
  ItemPairs swapped;
  std::vector<double> defined;
  for (auto a = engines.begin(); a != engines.end(); ++a) {
    for (auto b = std::next(a); b != engines.end(); ++b) {
      const ItemRates rates = item_rates(success, *a, *b, item_of);
      const RankAgreement agreement = kendall(rates.in_a, rates.in_b);
      stability.engines.push_back({.engine_a = *a,
                                   .engine_b = *b,
                                   .items = static_cast<long>(rates.items.size()),
                                   .pairs = agreement.pairs,
                                   .swapped = agreement.discordant,
                                   .tau_b = agreement.tau_b});
      collect_pairs(rates, all, swapped);
      if (std::isfinite(agreement.tau_b)) defined.push_back(agreement.tau_b);
    }
  }
  stability.mean_tau_b = mean_of(defined);
  stability.defined = static_cast<long>(defined.size());
  stability.item_pairs = static_cast<long>(all.size());
  stability.swapped = static_cast<long>(swapped.size());
  return stability;
}

std::string comma_separated(const std::set<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    if (!word.empty()) text.append(text.empty() ? "" : ", ").append(word);
  }
  return text;
}

std::vector<RunEngine> engine_infos(const std::vector<EpisodeRow>& rows, const std::string& arm) {
  std::map<std::string, std::pair<std::set<std::string>, std::set<std::string>>> engines;
  for (const EpisodeRow& row : rows) {
    if (row.arm != arm || row.engine == kPlaybackEngine) continue;
    engines[row.engine].first.insert(row.engine_version);
    engines[row.engine].second.insert(row.engine_profile);
  }
  std::vector<RunEngine> infos;
  infos.reserve(engines.size());
  for (const auto& [name, found] : engines)
    infos.push_back({name, comma_separated(found.first), comma_separated(found.second)});
  return infos;
}

}  // namespace

EngineRows::EngineRows(const std::vector<EpisodeRow>& rows, const std::string& arm) {
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm != arm) continue;
    const EpisodeRow*& place =
        row->engine == kPlaybackEngine
            ? playback_[{row->perturbation, row->policy, episode_id(*row)}][row->controller]
            : physics_[{row->perturbation, row->controller, row->policy}][episode_id(*row)][row->engine];
    if (place != nullptr) require_distinct(*place, *row);
    place = row;
  }
}

const EpisodeRow* EngineRows::playback(const Combination& combination, const EpisodeId& id) const {
  const auto found = playback_.find({combination.perturbation, combination.policy, id});
  if (found == playback_.end()) return nullptr;
  const auto same = found->second.find(combination.controller);
  return same != found->second.end() ? same->second : found->second.begin()->second;
}

std::vector<EngineSuccess> engine_success(const EngineRows& rows, const CrossEngineOptions& options) {
  std::vector<EngineSuccess> success;
  for (const auto& [combination, episodes] : rows.physics())
    success.push_back(success_of(combination, episodes, rows, options.intervals.level));
  return success;
}

std::vector<RankStability> rank_stability(const std::vector<EngineSuccess>& success) {
  std::set<std::string> controllers;
  std::set<std::string> policies;
  for (const EngineSuccess& entry : success) {
    controllers.insert(entry.controller);
    policies.insert(entry.policy);
  }
  std::vector<RankStability> ranks = {stability_of(
      "combinations", success, [](const EngineSuccess& entry) { return Item(entry.controller, entry.policy); })};
  if (controllers.size() < 2 || policies.size() < 2) return ranks;
  ranks.push_back(
      stability_of("controllers", success, [](const EngineSuccess& entry) { return Item(entry.controller, ""); }));
  ranks.push_back(stability_of("policies", success, [](const EngineSuccess& entry) { return Item("", entry.policy); }));
  return ranks;
}

CrossEngine cross_engine(const std::vector<EpisodeRow>& rows, const std::vector<MetricColumn>& metrics,
                         const CrossEngineOptions& options) {
  const EngineRows by_engine(rows, options.arm);
  CrossEngine result;
  result.engines = engine_infos(rows, options.arm);
  result.has_playback = by_engine.has_playback();
  result.level = options.intervals.level;
  result.parting_distance = options.parting_distance;
  result.metrics = metrics;
  if (result.engines.size() < 2) return result;
  result.success = engine_success(by_engine, options);
  result.ranks = rank_stability(result.success);
  add_rank_reliability(by_engine, options, result.ranks);
  result.drift = metric_drift(by_engine, metrics, options);
  result.parting = engine_parting(by_engine, options);
  result.forces = force_agreement(by_engine);
  return result;
}

}  // namespace duet
