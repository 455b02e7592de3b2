#include "duet/report/ranking/policy_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "duet/core/order_statistics.h"
#include "duet/report/ranking/comparison_parts.h"
#include "duet/report/ranking/contact_table.h"
#include "duet/report/ranking/leaderboard_rows.h"

namespace duet {
namespace {

constexpr std::string_view kPaperDetector = "paper/paper";
constexpr std::string_view kReplay = "replay";
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

constexpr std::array<PaperTaskRate, 6> rates(double hug, double handshake, double high_five, double wave, double bend,
                                             double fly_kiss) {
  return {{{Task::kHug, hug},
           {Task::kHandshake, handshake},
           {Task::kHighFive, high_five},
           {Task::kWave, wave},
           {Task::kBend, bend},
           {Task::kFlyKiss, fly_kiss}}};
}

// Source: supplement C.3.3, Table S9.
constexpr std::array<PaperPolicy, 9> kPaperPolicies = {
    {{"D-STAR", "", 0.0, 84.9, rates(93.3, 77.4, 70.4, 96.3, 93.3, 90.9)},
     {"D-STAR, jitter 1 cm", "jitter", 0.01, 80.2, rates(93.3, 64.5, 63.0, 96.3, 93.3, 90.9)},
     {"D-STAR, jitter 2 cm", "jitter", 0.02, 79.4, rates(100.0, 61.3, 59.3, 96.3, 93.3, 90.9)},
     {"D-STAR, jitter 5 cm", "jitter", 0.05, 77.8, rates(100.0, 58.1, 55.6, 96.3, 93.3, 90.9)},
     {"D-STAR, dropout 0.05", "dropout", 0.05, 78.6, rates(100.0, 61.3, 59.3, 92.6, 93.3, 90.9)},
     {"D-STAR, dropout 0.1", "dropout", 0.1, 78.6, rates(93.3, 67.7, 51.9, 96.3, 93.3, 90.9)},
     {"D-STAR, dropout 0.2", "dropout", 0.2, 75.4, rates(93.3, 58.1, 48.1, 96.3, 93.3, 90.9)},
     {"D-STAR, HOMIE, waist free", "", 0.0, 67.8, rates(66.8, 46.7, 33.8, 93.8, 96.0, 86.4)},
     {"D-STAR, HOMIE, waist locked", "", 0.0, 66.1, rates(56.2, 47.5, 32.9, 93.8, 97.5, 86.4)}}};

// The success rate of an entry under the paper's detector, over its n episodes; none where no row has the verdict.
Rate paper_rate(const LeaderboardEntry& entry) {
  const auto found = entry.other_success.find(std::string(kPaperDetector));
  if (found == entry.other_success.end()) return {};
  return make_rate(std::lround(found->second * static_cast<double>(entry.n)), entry.n, entry.level);
}

Rate rate_of(const LeaderboardEntry& entry) {
  return {.n = entry.n, .k = entry.k, .rate = entry.success, .interval = entry.interval};
}

void take_overall(const LeaderboardEntry& entry, PolicyFigures& figures) {
  figures.success = rate_of(entry);
  figures.paper = paper_rate(entry);
  figures.lift = {.pairs = entry.pairs, .difference = entry.lift, .interval = entry.lift_interval};
  figures.falls = make_rate(entry.fell, entry.n, entry.level);
  const auto jerk = entry.metrics.find("dof_jerk");
  figures.dof_jerk = jerk == entry.metrics.end() ? kNone : jerk->second;
}

Rate violation_rate(const EpisodeRows& rows, double level) {
  long solid = 0;
  long over = 0;
  for (const auto& [id, row] : rows) {
    if (!has_solid_partner(*row)) continue;
    ++solid;
    over += is_over_limit(*row) ? 1 : 0;
  }
  return make_rate(over, solid, level);
}

// Median over the episodes that have it; NaN where none has.
template <typename Value>
double median_of(const EpisodeRows& rows, Value value) {
  std::vector<double> values;
  for (const auto& [id, row] : rows)
    if (const double of = value(*row); std::isfinite(of)) values.push_back(of);
  return quantile(std::move(values), 0.5);
}

double force_of(const EpisodeRow& row, const char* name) {
  const auto found = row.forces.find(name);
  return found == row.forces.end() ? kNone : found->second;
}

// The mean force of the ground on a robot that stands is its weight.
double stamping_of(const EpisodeRow& row) {
  const double mean = force_of(row, "ground.mean_n");
  return mean > 0.0 ? force_of(row, "ground.peak_n") / mean : kNone;
}

void add_forces(const EpisodeRows& rows, PolicyFigures& of) {
  const auto touching = [](const char* name) {
    return [name](const EpisodeRow& row) { return force_of(row, "human.peak_n") > 0.0 ? force_of(row, name) : kNone; };
  };
  of.contact_peak = median_of(rows, touching("human.peak_n"));
  of.contact_settled = median_of(rows, touching("human.settled_n"));
  of.stamping = median_of(rows, stamping_of);
}

bool is_playback(const PolicyFigures& figures) { return figures.key.engine == kPlaybackEngine; }

// Sets the mean over physics engines of the episodes that all of them ran.
void add_mean(const std::map<PolicyKey, PerturbedRows>& policies, double level, PolicyLine& line) {
  std::vector<const EpisodeRows*> engines;
  for (const PolicyFigures& figures : line.engines)
    if (!is_playback(figures)) engines.push_back(&policies.at(figures.key).find(kClean)->second);
  line.mean_success = line.mean_interval.low = line.mean_interval.high = kNone;
  if (engines.empty()) return;
  SuccessByClip means;
  for (const auto& [id, row] : *engines.front()) {
    double successes = 0.0;
    bool in_all = true;
    for (const EpisodeRows* episodes : engines) {
      const auto found = episodes->find(id);
      in_all = in_all && found != episodes->end();
      if (in_all) successes += headline_success(*found->second) ? 1.0 : 0.0;
    }
    if (in_all) means.add(id, successes / static_cast<double>(engines.size()));
  }
  if (means.clips() == 0) return;
  line.mean_success = means.mean();
  line.mean_interval = means.by_clip(level);
}

using LineKey = std::tuple<std::string, std::string, std::string>;

std::map<LineKey, PolicyLine> lines_of(const std::vector<LeaderboardEntry>& entries,
                                       const std::map<PolicyKey, PerturbedRows>& policies, double level) {
  std::map<PolicyKey, PolicyFigures> figures;
  for (const LeaderboardEntry& entry : entries) {
    const PolicyKey key{entry.engine, entry.controller, entry.arm, entry.policy};
    const auto rows = policies.find(key);
    if (entry.perturbation != kClean || rows == policies.end() || !rows->second.contains(kClean)) continue;
    PolicyFigures& of = figures[key];
    of.key = key;
    of.by_task[entry.task] = rate_of(entry);
    of.by_task_paper[entry.task] = paper_rate(entry);
    if (entry.task != "all") continue;
    take_overall(entry, of);
    of.violations = violation_rate(rows->second.find(kClean)->second, level);
    add_forces(rows->second.find(kClean)->second, of);
  }
  std::map<LineKey, PolicyLine> lines;
  for (auto& [key, of] : figures) {
    PolicyLine& line = lines[{key.controller, key.arm, key.policy}];
    std::tie(line.controller, line.arm, line.policy) = std::tie(key.controller, key.arm, key.policy);
    line.engines.push_back(std::move(of));
  }
  for (auto& [key, line] : lines)
    std::stable_partition(line.engines.begin(), line.engines.end(),
                          [](const PolicyFigures& of) { return !is_playback(of); });
  return lines;
}

std::optional<Comparison> compared(const PolicyKey& a, const EpisodeRows& of_a, const PolicyKey& b,
                                   const EpisodeRows& of_b, const IntervalOptions& options) {
  PairedRows gathered;
  for (const auto& [id, row] : of_a) {
    const auto found = of_b.find(id);
    found == of_b.end() ? void(++gathered.unpaired_a) : gathered.pairs.add(*row, *found->second);
  }
  if (gathered.pairs.table().pairs() == 0) return std::nullopt;
  gathered.unpaired_b = static_cast<long>(of_b.size()) - gathered.pairs.table().pairs();
  Comparison pair = evaluate(gathered, options);
  pair.group = fmt::format("{}/{}: {} vs {}", a.engine, a.controller, a.policy, b.policy);
  std::tie(pair.engine, pair.controller, pair.perturbation, pair.task) =
      std::tuple(a.engine, a.controller, std::string(kClean), "all");
  pair.policy = fmt::format("{} vs {}", a.policy, b.policy);
  return pair;
}

// Every policy with every other of the same engine and controller.
std::vector<Comparison> all_pairs(const std::map<PolicyKey, PerturbedRows>& policies, const IntervalOptions& options) {
  std::vector<Comparison> pairs;
  for (auto a = policies.begin(); a != policies.end(); ++a) {
    for (auto b = std::next(a); b != policies.end(); ++b) {
      if (std::tie(a->first.engine, a->first.controller) != std::tie(b->first.engine, b->first.controller)) break;
      const auto of_a = a->second.find(kClean);
      const auto of_b = b->second.find(kClean);
      if (of_a == a->second.end() || of_b == b->second.end()) continue;
      if (auto pair = compared(a->first, of_a->second, b->first, of_b->second, options))
        pairs.push_back(*std::move(pair));
    }
  }
  correct_for_family(pairs);
  return pairs;
}

std::map<std::string, long> policies_that_never_ran(const std::vector<LeaderboardEntry>& entries) {
  std::map<std::string, std::pair<long, long>> episodes;  // all, unsupported
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || entry.arm == "null") continue;
    episodes[entry.policy].first += entry.n;
    episodes[entry.policy].second += entry.unsupported;
  }
  std::map<std::string, long> never;
  for (const auto& [policy, counts] : episodes)
    if (counts.first == counts.second) never[policy] = counts.first;
  return never;
}

}  // namespace

std::span<const PaperPolicy> paper_policies() { return kPaperPolicies; }

OverEngines over_engines(const PolicyLine& line, const PolicyFigure& figure) {
  OverEngines over{.engines = 0, .mean = kNone, .range = kNone, .worst = ""};
  double sum = 0.0;
  double low = kNone;
  double high = kNone;
  for (const PolicyFigures& figures : line.engines) {
    const double value = figure.value(figures);
    if (is_playback(figures) || !std::isfinite(value)) continue;
    const bool is_worse = figure.higher_is_better ? !(value >= low) : !(value <= high);
    if (over.engines++ == 0 || is_worse) over.worst = figures.key.engine;
    low = std::fmin(low, value);
    high = std::fmax(high, value);
    sum += value;
  }
  if (over.engines == 0) return over;
  over.mean = sum / static_cast<double>(over.engines);
  over.range = high - low;
  return over;
}

PolicyTable policy_table(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  PolicyTable table{.level = options.level, .lines = {}, .pairs = {}, .could_not_run = {}, .faults = {}};
  const std::map<PolicyKey, PerturbedRows> policies = rows_of_policies(rows);
  if (std::all_of(policies.begin(), policies.end(), [](const auto& of) { return of.first.policy == kReplay; }))
    return table;
  const std::vector<LeaderboardEntry> entries = leaderboard(rows, options);
  for (auto& [key, line] : lines_of(entries, policies, options.level)) {
    add_mean(policies, options.level, line);
    table.lines.push_back(std::move(line));
  }
  table.pairs = all_pairs(policies, options);
  table.could_not_run = policies_that_never_ran(entries);
  table.faults = policy_fault_notes(entries);
  return table;
}

}  // namespace duet
