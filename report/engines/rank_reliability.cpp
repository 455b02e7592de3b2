// How far the order of items in one engine can be relied on in another: figures over the pairs of engines, each with an
// interval from clips that are drawn again within their task.
#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/random.h"
#include "duet/core/require.h"
#include "duet/report/engines/cross_engine_parts.h"

namespace duet {
namespace {

constexpr double kSameRate = 1e-9;        // as in kendall
constexpr int kMostRankResamples = 2000;  // ten thousand take seconds and move the ends by less than a point

bool is_below(double a, double b) { return a < b - kSameRate; }

std::vector<std::size_t> best_of(std::span<const double> rates) {
  const double best = *std::max_element(rates.begin(), rates.end());
  std::vector<std::size_t> winners;
  for (std::size_t i = 0; i < rates.size(); ++i)
    if (!is_below(rates[i], best)) winners.push_back(i);
  return winners;
}

// Successes of one clip in one engine.
struct ClipCount {
  std::size_t clip = 0;
  double n = 0.0, k = 0.0;
};

// One combination of controller, policy and perturbation.
struct RankedEntry {
  std::size_t item = 0;
  std::map<std::string, std::vector<ClipCount>> engines;
};

struct RankedEntries {
  std::vector<RankedEntry> entries;
  std::size_t items = 0;
  std::vector<std::vector<std::size_t>> clips_of_task;
  std::size_t clips = 0;
  std::vector<std::string> engines;
};

using RankItem = std::pair<std::string, std::string>;

RankItem item_named(const std::string& of, const Combination& combination) {
  return {of == "policies" ? "" : combination.controller, of == "controllers" ? "" : combination.policy};
}

// Entries over the episodes that all engines of a combination ran, as its success is.
RankedEntries ranked_entries(const EngineRows& rows, const std::string& of) {
  RankedEntries all;
  std::map<RankItem, std::size_t> items;
  std::map<std::string, std::map<std::string, std::size_t>> clips;
  for (const auto& [combination, episodes] : rows.physics()) {
    RankedEntry entry{.item = items.try_emplace(item_named(of, combination), items.size()).first->second,
                      .engines = {}};
    std::map<std::string, bool> engines;
    for (const auto& [id, row_of] : episodes)
      for (const auto& [engine, row] : row_of) engines[engine] = true;
    for (const auto& [id, row_of] : episodes) {
      if (row_of.size() < engines.size()) continue;
      const auto [clip, is_new] = clips[id.task].try_emplace(id.clip, all.clips);
      all.clips += is_new ? 1 : 0;
      for (const auto& [engine, row] : row_of)
        entry.engines[engine].push_back({clip->second, 1.0, headline_success(*row) ? 1.0 : 0.0});
    }
    for (const auto& [engine, present] : engines)
      if (std::ranges::find(all.engines, engine) == all.engines.end()) all.engines.push_back(engine);
    all.entries.push_back(std::move(entry));
  }
  std::sort(all.engines.begin(), all.engines.end());
  all.items = items.size();
  for (const auto& [task, of_task] : clips) {
    std::vector<std::size_t>& list = all.clips_of_task.emplace_back();
    for (const auto& [clip, number] : of_task) list.push_back(number);
  }
  return all;
}

// NaN where the drawn clips have no episode.
double rate_of(const std::vector<ClipCount>& counts, std::span<const double> weights) {
  double n = 0.0, k = 0.0;
  for (const ClipCount& count : counts) {
    n += weights[count.clip] * count.n;
    k += weights[count.clip] * count.k;
  }
  return n > 0.0 ? k / n : std::numeric_limits<double>::quiet_NaN();
}

struct PairRates {
  std::vector<double> in_a, in_b;
};

// Mean rates per item over the entries that both engines have.
PairRates pair_rates(const RankedEntries& all, const std::vector<std::map<std::string, double>>& rates,
                     const std::string& a, const std::string& b) {
  std::vector<double> sum_a(all.items), sum_b(all.items), counts(all.items);
  for (std::size_t i = 0; i < rates.size(); ++i) {
    const auto in_a = rates[i].find(a), in_b = rates[i].find(b);
    if (in_a == rates[i].end() || in_b == rates[i].end()) continue;
    if (std::isnan(in_a->second) || std::isnan(in_b->second)) continue;
    const std::size_t item = all.entries[i].item;
    sum_a[item] += in_a->second;
    sum_b[item] += in_b->second;
    counts[item] += 1.0;
  }
  PairRates result;
  for (std::size_t item = 0; item < all.items; ++item) {
    if (counts[item] == 0.0) continue;
    result.in_a.push_back(sum_a[item] / counts[item]);
    result.in_b.push_back(sum_b[item] / counts[item]);
  }
  return result;
}

double mean_or_nan(double sum, long count) {
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

struct RankFigures {
  double tau_b = 0.0, violation = 0.0, winner_changes = 0.0;
};

RankFigures figures_of(const RankedEntries& all, std::span<const double> weights) {
  std::vector<std::map<std::string, double>> rates(all.entries.size());
  for (std::size_t i = 0; i < rates.size(); ++i)
    for (const auto& [engine, counts] : all.entries[i].engines) rates[i][engine] = rate_of(counts, weights);
  RankFigures sums;
  long defined = 0, pairs = 0;
  for (std::size_t a = 0; a < all.engines.size(); ++a) {
    for (std::size_t b = a + 1; b < all.engines.size(); ++b) {
      const PairRates pair = pair_rates(all, rates, all.engines[a], all.engines[b]);
      if (pair.in_a.size() < 2) continue;
      const double tau_b = kendall(pair.in_a, pair.in_b).tau_b;
      if (std::isfinite(tau_b)) {
        sums.tau_b += tau_b;
        ++defined;
      }
      sums.violation +=
          0.5 * (mean_maximum_rank_violation(pair.in_a, pair.in_b) + mean_maximum_rank_violation(pair.in_b, pair.in_a));
      sums.winner_changes += winner_change(pair.in_a, pair.in_b);
      ++pairs;
    }
  }
  return {mean_or_nan(sums.tau_b, defined), mean_or_nan(sums.violation, pairs),
          mean_or_nan(sums.winner_changes, pairs)};
}

Interval interval_of(std::vector<double> values, double level) {
  std::erase_if(values, [](double value) { return std::isnan(value); });
  std::sort(values.begin(), values.end());
  return {.low = quantile_of_sorted(values, 0.5 - 0.5 * level), .high = quantile_of_sorted(values, 0.5 + 0.5 * level)};
}

void add_figures(const EngineRows& rows, const CrossEngineOptions& options, RankStability& ranks) {
  const RankedEntries all = ranked_entries(rows, ranks.of);
  std::vector<double> weights(all.clips, 1.0);
  const RankFigures found = figures_of(all, weights);
  ranks.rank_violation = found.violation;
  ranks.winner_changes = found.winner_changes;
  Random random(options.intervals.seed, stream_key({"rank_reliability", ranks.of}));
  std::vector<double> tau_b, violation, winner_changes;
  const int resamples = ranks.items < 2 ? 0 : std::min(options.intervals.resamples, kMostRankResamples);
  for (int i = 0; i < resamples; ++i) {
    std::fill(weights.begin(), weights.end(), 0.0);
    for (const std::vector<std::size_t>& clips : all.clips_of_task)
      for (std::size_t j = 0; j < clips.size(); ++j)
        weights[clips[static_cast<std::size_t>(random.below(static_cast<int>(clips.size())))]] += 1.0;
    const RankFigures drawn = figures_of(all, weights);
    tau_b.push_back(drawn.tau_b);
    violation.push_back(drawn.violation);
    winner_changes.push_back(drawn.winner_changes);
  }
  ranks.tau_interval = interval_of(std::move(tau_b), options.intervals.level);
  ranks.violation_interval = interval_of(std::move(violation), options.intervals.level);
  ranks.winner_interval = interval_of(std::move(winner_changes), options.intervals.level);
}

}  // namespace

double mean_maximum_rank_violation(std::span<const double> reference, std::span<const double> other) {
  require(reference.size() == other.size() && !reference.empty(),
          "rank violation: expected as many rates in both engines, and one or more");
  double sum = 0.0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    double largest = 0.0;
    for (std::size_t j = 0; j < reference.size(); ++j) {
      if (is_below(other[i], other[j]) != is_below(reference[i], reference[j]))
        largest = std::max(largest, std::abs(reference[i] - reference[j]));
    }
    sum += largest;
  }
  return sum / static_cast<double>(reference.size());
}

double winner_change(std::span<const double> a, std::span<const double> b) {
  require(a.size() == b.size() && !a.empty(), "winner: expected as many rates in both engines, and one or more");
  const std::vector<std::size_t> of_a = best_of(a), of_b = best_of(b);
  const bool shared =
      std::ranges::any_of(of_a, [&](std::size_t winner) { return std::ranges::count(of_b, winner) > 0; });
  return shared ? 0.0 : 1.0;
}

void add_rank_reliability(const EngineRows& rows, const CrossEngineOptions& options,
                          std::vector<RankStability>& ranks) {
  for (RankStability& of : ranks) add_figures(rows, options, of);
}

}  // namespace duet
