// Rows by engine and success per engine.
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
  result.ranks = rank_stability(by_engine, result.success, options);
  result.drift = metric_drift(by_engine, metrics, options);
  result.parting = engine_parting(by_engine, options);
  result.forces = force_agreement(by_engine);
  return result;
}

}  // namespace duet
