// Whether engines put items in the same order by success, and how far the order in one can be relied on in another:
// estimates over the pairs of engines, with intervals from clips that are drawn again within their task.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/report/engines/cross_engine.h"

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

// An item of "combinations", "controllers" or "policies".
RankItem item_named(const std::string& of, const std::string& controller, const std::string& policy) {
  return {of == "policies" ? "" : controller, of == "controllers" ? "" : policy};
}

// Entries over the episodes that all engines of a combination ran, as its success is.
RankedEntries ranked_entries(const EngineRows& rows, const std::string& of) {
  RankedEntries all;
  std::map<RankItem, std::size_t> items;
  std::map<std::string, std::map<std::string, std::size_t>> clips;
  for (const auto& [combination, episodes] : rows.physics()) {
    RankedEntry entry{
        .item =
            items.try_emplace(item_named(of, combination.controller, combination.policy), items.size()).first->second,
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
      sums.violation += rank_violation_of_both(pair.in_a, pair.in_b);
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

// Items with their mean success in two engines.
struct ItemRates {
  std::vector<RankItem> items;
  std::vector<double> in_a, in_b;
};

const EngineRate* rate_in(const EngineSuccess& success, const std::string& engine) {
  for (const EngineRate& rate : success.engines) {
    if (rate.engine == engine && rate.n > 0) return &rate;
  }
  return nullptr;
}

ItemRates item_rates(const std::vector<EngineSuccess>& success, const std::string& a, const std::string& b,
                     const std::string& of) {
  std::map<RankItem, std::pair<std::vector<double>, std::vector<double>>> rates;
  for (const EngineSuccess& entry : success) {
    const EngineRate* in_a = rate_in(entry, a);
    const EngineRate* in_b = rate_in(entry, b);
    if (in_a == nullptr || in_b == nullptr) continue;
    auto& [of_a, of_b] = rates[item_named(of, entry.controller, entry.policy)];
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

using ItemPairs = std::set<std::pair<RankItem, RankItem>>;

// Collects all pairs of items, and those in opposite order in the two engines.
void collect_pairs(const ItemRates& rates, ItemPairs& all, ItemPairs& swapped) {
  for (std::size_t i = 0; i < rates.items.size(); ++i) {
    for (std::size_t j = i + 1; j < rates.items.size(); ++j) {
      const std::pair<RankItem, RankItem> pair = {rates.items[i], rates.items[j]};
      const std::vector<double> a = {rates.in_a[i], rates.in_a[j]};
      const std::vector<double> b = {rates.in_b[i], rates.in_b[j]};
      all.insert(pair);
      if (kendall(a, b).discordant > 0) swapped.insert(pair);
    }
  }
}

struct EnginePairs {
  std::set<std::string> engines;
  ItemPairs all, swapped;
  std::vector<double> defined;  // tau-b of the pairs of engines that have one
  long count = 0;               // of the pairs of engines
};

// Adds tau-b and swapped pairs of items for every two engines.
EnginePairs add_engine_pairs(const std::vector<EngineSuccess>& success, EstimatesOf of) {
  EnginePairs pairs;
  for (const EngineSuccess& entry : success)
    for (const EngineRate& rate : entry.engines) pairs.engines.insert(rate.engine);
  for (auto a = pairs.engines.begin(); a != pairs.engines.end(); ++a) {
    for (auto b = std::next(a); b != pairs.engines.end(); ++b) {
      const ItemRates rates = item_rates(success, *a, *b, of.keys.of);
      const RankAgreement agreement = kendall(rates.in_a, rates.in_b);
      of.keys.engine = versus(*a, *b);
      of.add("tau_b", static_cast<long>(rates.items.size()), agreement.tau_b);
      of.count("swapped", agreement.pairs, agreement.discordant);
      collect_pairs(rates, pairs.all, pairs.swapped);
      if (std::isfinite(agreement.tau_b)) pairs.defined.push_back(agreement.tau_b);
      ++pairs.count;
    }
  }
  return pairs;
}

struct RankIntervals {
  Interval tau_b, violation, winner_changes;
};

RankIntervals drawn_again(const RankedEntries& all, const std::string& of, const IntervalOptions& options,
                          int resamples) {
  Random random(options.seed, stream_key({"rank_reliability", of}));
  std::vector<double> weights(all.clips), tau_b, violation, winner_changes;
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
  return {interval_of(std::move(tau_b), options.level), interval_of(std::move(violation), options.level),
          interval_of(std::move(winner_changes), options.level)};
}

void add_ranks(const EngineRows& rows, const std::vector<EngineSuccess>& success, const std::string& name,
               const IntervalOptions& options, Estimates& into) {
  EstimatesOf of{{.of = name}, into};
  const EnginePairs pairs = add_engine_pairs(success, of);
  const RankedEntries all = ranked_entries(rows, name);
  const RankFigures found = figures_of(all, std::vector<double>(all.clips, 1.0));
  const RankIntervals intervals =
      drawn_again(all, name, options, all.items < 2 ? 0 : std::min(options.resamples, kMostRankResamples));
  of.keys.engine = "all";
  of.count("items", {}, static_cast<long>(all.items));
  of.add("mean_tau_b", static_cast<long>(pairs.defined.size()), mean_of(pairs.defined), intervals.tau_b);
  of.add("rank_violation", pairs.count, found.violation, intervals.violation);
  of.add("winner_changes", pairs.count, found.winner_changes, intervals.winner_changes);
  of.count("swapped", static_cast<long>(pairs.all.size()), static_cast<long>(pairs.swapped.size()));
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

double rank_violation_of_both(std::span<const double> a, std::span<const double> b) {
  return 0.5 * (mean_maximum_rank_violation(a, b) + mean_maximum_rank_violation(b, a));
}

double winner_change(std::span<const double> a, std::span<const double> b) {
  require(a.size() == b.size() && !a.empty(), "winner: expected as many rates in both engines, and one or more");
  const std::vector<std::size_t> of_a = best_of(a), of_b = best_of(b);
  const bool shared =
      std::ranges::any_of(of_a, [&](std::size_t winner) { return std::ranges::count(of_b, winner) > 0; });
  return shared ? 0.0 : 1.0;
}

Estimates rank_stability(const EngineRows& rows, const std::vector<EngineSuccess>& success,
                         const CrossEngineOptions& options) {
  std::set<std::string> controllers, policies;
  for (const EngineSuccess& entry : success) {
    controllers.insert(entry.controller);
    policies.insert(entry.policy);
  }
  std::vector<std::string> names = {"combinations"};
  if (controllers.size() > 1 && policies.size() > 1) names.insert(names.end(), {"controllers", "policies"});
  Estimates ranks;
  for (const std::string& name : names) add_ranks(rows, success, name, options.intervals, ranks);
  return ranks;
}

}  // namespace duet
