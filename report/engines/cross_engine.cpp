// Rows by engine and success per engine.
#include "duet/report/engines/cross_engine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "duet/core/require.h"
#include "duet/rows/groups/row_groups.h"

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

// Drift of metrics from playback, the time at which engines part, agreement of contact forces.

namespace {

struct DriftDifferences {
  std::vector<double> playback, values;
  std::vector<int> clips;
};

using DriftKey = std::tuple<std::string, std::size_t, std::string>;  // controller, place of the metric, engine

void gather_drift(const EpisodeRow& row, const EpisodeRow& playback, const std::vector<MetricColumn>& metrics, int clip,
                  std::map<DriftKey, DriftDifferences>& gathered) {
  for (std::size_t i = 0; i < metrics.size(); ++i) {
    const auto here = row.metrics.find(metrics[i].name);
    const auto there = playback.metrics.find(metrics[i].name);
    if (here == row.metrics.end() || there == playback.metrics.end()) continue;
    DriftDifferences& differences = gathered[{row.controller, i, row.engine}];
    differences.playback.push_back(there->second);
    differences.values.push_back(here->second - there->second);
    differences.clips.push_back(clip);
  }
}

// Places of the points that both traces have, in a and in b.
std::vector<std::pair<std::size_t, std::size_t>> shared_points(const StateTrace& a, const StateTrace& b) {
  std::vector<std::pair<std::size_t, std::size_t>> places;
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    const auto found = std::find(b.points.begin(), b.points.end(), a.points[i]);
    if (found != b.points.end()) places.emplace_back(i, static_cast<std::size_t>(found - b.points.begin()));
  }
  return places;
}

double distance_mm(const std::vector<int>& a, std::size_t i, const std::vector<int>& b, std::size_t j) {
  const auto difference = [&](std::size_t axis) {
    return static_cast<double>(a[3 * i + axis]) - static_cast<double>(b[3 * j + axis]);
  };
  return std::hypot(difference(0), difference(1), difference(2));
}

bool broke_down(const EpisodeRow& row) {
  return row.fell || row.outcome == Outcome::kFell || row.outcome == Outcome::kDiverged;
}

struct Watched {
  std::vector<Lifetime> lifetimes;
  long without_trace = 0;
};

using EnginePair = std::tuple<std::string, std::string, std::string>;  // controller, engines

struct ForceSamples {
  std::vector<double> typical, spread;
  std::map<std::string, std::vector<double>> ratio;
};

// The force in the engines that have it.
std::map<std::string, double> force_in(const RowPerEngine& row_of, const std::string& name) {
  std::map<std::string, double> values;
  for (const auto& [engine, row] : row_of) {
    if (const auto found = row->forces.find(name); found != row->forces.end()) values[engine] = found->second;
  }
  return values;
}

void gather_force(const std::map<std::string, double>& in_engine, ForceSamples& samples) {
  if (in_engine.size() < 2) return;
  std::vector<double> values;
  values.reserve(in_engine.size());
  for (const auto& [engine, value] : in_engine) values.push_back(value);
  std::sort(values.begin(), values.end());
  const double mean = mean_of(values);
  if (!(mean > 0.0)) return;
  const double median = quantile_of_sorted(values, 0.5);
  samples.typical.push_back(median);
  samples.spread.push_back((values.back() - values.front()) / mean);
  for (const auto& [engine, value] : in_engine) {
    if (median > 0.0) samples.ratio[engine].push_back(value / median);
  }
}

// Names of forces without flags and ratios, whose names end with no unit.
std::set<std::string> force_names(const EngineRows& rows) {
  std::set<std::string> names;
  for (const auto& [combination, episodes] : rows.physics()) {
    for (const auto& [id, row_of] : episodes) {
      for (const auto& [engine, row] : row_of) {
        for (const auto& [name, value] : row->forces) {
          if (!force_unit(name).empty()) names.insert(name);
        }
      }
    }
  }
  return names;
}

struct Traced {
  const EpisodeRow& row;
  const StateTrace& trace;
};

std::optional<Lifetime> time_together(const Traced& a, const Traced& b, double distance) {
  const auto points = shared_points(a.trace, b.trace);
  const std::size_t frames = std::min(a.trace.mm.size(), b.trace.mm.size());
  if (frames == 0 || points.empty() || a.trace.rate_hz != b.trace.rate_hz) return std::nullopt;
  const auto time = [&](std::size_t frame) { return static_cast<double>(frame) / a.trace.rate_hz; };
  for (std::size_t frame = 0; frame < frames; ++frame) {
    for (const auto& [i, j] : points) {
      if (distance_mm(a.trace.mm[frame], i, b.trace.mm[frame], j) > 1000.0 * distance) {
        return Lifetime{.time = time(frame), .ended = true};
      }
    }
  }
  // Where one alone falls or diverges, they part where its trace ends, unless the other's ended before.
  const bool a_alone = broke_down(a.row) && !broke_down(b.row) && a.trace.mm.size() == frames;
  const bool b_alone = broke_down(b.row) && !broke_down(a.row) && b.trace.mm.size() == frames;
  return Lifetime{.time = time(frames - 1), .ended = a_alone || b_alone};
}

}  // namespace

std::string versus(const std::string& a, const std::string& b) { return a + " vs " + b; }

Estimates metric_drift(const EngineRows& rows, const std::vector<MetricColumn>& metrics,
                       const CrossEngineOptions& options) {
  std::map<DriftKey, DriftDifferences> gathered;
  ClipNumbers clips;
  for (const auto& [combination, episodes] : rows.physics()) {
    for (const auto& [id, row_of] : episodes) {
      const EpisodeRow* playback = rows.playback(combination, id);
      if (playback == nullptr) continue;
      for (const auto& [engine, row] : row_of) gather_drift(*row, *playback, metrics, clips.of(id), gathered);
    }
  }
  ClusterBootstrap bootstrap(options.intervals.resamples, options.intervals.seed);
  Estimates drift;
  for (const auto& [key, differences] : gathered) {
    const auto& [controller, place, engine] = key;
    const MetricColumn& metric = metrics[place];
    const EstimatesOf of{{.engine = engine, .controller = controller, .of = metric.name}, drift};
    const auto pairs = static_cast<long>(differences.values.size());
    of.add("playback", pairs, mean_of(differences.playback), kNoInterval, metric.unit);
    of.add("drift", pairs, mean_of(differences.values),
           bootstrap.mean(differences.values, differences.clips, options.intervals.level), metric.unit);
  }
  return drift;
}

std::optional<Lifetime> time_together(const EpisodeRow& a, const EpisodeRow& b, double distance) {
  return time_together({a, a.trace}, {b, b.trace}, distance);
}

Estimates engine_parting(const EngineRows& rows, const CrossEngineOptions& options) {
  std::map<EnginePair, Watched> watched;
  for (const auto& [combination, episodes] : rows.physics()) {
    for (const auto& [id, row_of] : episodes) {
      std::map<std::string, StateTrace> traces;
      if (row_of.size() > 1)
        for (const auto& [engine, row] : row_of) traces[engine] = options.file.trace(*row);
      for (auto a = row_of.begin(); a != row_of.end(); ++a) {
        for (auto b = std::next(a); b != row_of.end(); ++b) {
          Watched& pair = watched[{combination.controller, a->first, b->first}];
          const std::optional<Lifetime> lifetime = time_together(
              {*a->second, traces.at(a->first)}, {*b->second, traces.at(b->first)}, options.parting_distance);
          lifetime.has_value() ? pair.lifetimes.push_back(*lifetime) : void(++pair.without_trace);
        }
      }
    }
  }
  Estimates parting;
  for (const auto& [key, pair] : watched) {
    const auto& [controller, a, b] = key;
    const EstimatesOf of{{.engine = versus(a, b), .controller = controller}, parting};
    const auto pairs = static_cast<long>(pair.lifetimes.size());
    for (const auto& [name, share] : {std::pair("parting_lower_quartile", 0.25), std::pair("parting_median", 0.5),
                                      std::pair("parting_upper_quartile", 0.75)})
      of.add(name, pairs, kaplan_meier_quantile(pair.lifetimes, share), kNoInterval, "s");
    of.count("parted", pairs, std::ranges::count(pair.lifetimes, true, &Lifetime::ended));
    of.count("without_trace", {}, pair.without_trace);
  }
  return parting;
}

Estimates force_agreement(const EngineRows& rows) {
  Estimates agreement;
  for (const std::string& name : force_names(rows)) {
    ForceSamples samples;
    for (const auto& [combination, episodes] : rows.physics()) {
      for (const auto& [id, row_of] : episodes) gather_force(force_in(row_of, name), samples);
    }
    if (samples.typical.empty()) continue;
    EstimatesOf of{{.engine = "all", .of = name}, agreement};
    const auto episodes = static_cast<long>(samples.typical.size());
    of.add("typical_force", episodes, quantile(samples.typical, 0.5), kNoInterval, force_unit(name));
    of.add("force_spread", episodes, quantile(samples.spread, 0.5));
    for (const auto& [engine, ratios] : samples.ratio) {
      of.keys.engine = engine;
      of.add("force_ratio", episodes, quantile(ratios, 0.5));
    }
  }
  return agreement;
}

std::string force_unit(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, const char*>, 4> kEndings = {
      {{"_n", "N"}, {"_ns", "N s"}, {"_s", "s"}, {"_n_cm2", "N/cm^2"}}};
  for (const auto& [ending, unit] : kEndings) {
    if (name.ends_with(ending)) return unit;
  }
  return "";
}

}  // namespace duet
