#include "duet/report/ranking/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "duet/core/require.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/statistics/clustered.h"

namespace duet {
namespace {

using RowList = std::vector<const EpisodeRow*>;

struct GroupField {
  const char* name;
  std::string EpisodeRow::*value;
};
constexpr std::array<GroupField, 4> kFields = {{{"engine", &EpisodeRow::engine},
                                                {"controller", &EpisodeRow::controller},
                                                {"policy", &EpisodeRow::policy},
                                                {"perturbation", &EpisodeRow::perturbation}}};

std::set<std::string> values_of(const RowList& rows, std::string EpisodeRow::*field) {
  std::set<std::string> values;
  for (const EpisodeRow* row : rows) values.insert(row->*field);
  return values;
}

bool disjoint(const std::set<std::string>& a, const std::set<std::string>& b) {
  return std::none_of(a.begin(), a.end(), [&](const std::string& value) { return b.contains(value); });
}

std::string listed(const std::set<std::string>& values) {
  std::string text;
  int shown = 0;
  for (const std::string& value : values) {
    if (++shown > 6) return fmt::format("{}, ... ({} in all)", text, values.size());
    text.append(text.empty() ? "" : ", ").append(value);
  }
  return text;
}

// The fields by which rows pair, and for those that differ the text that says what is compared with what.
struct Pairing {
  std::array<std::optional<std::string>, kFields.size()> contrast;

  [[nodiscard]] std::array<std::string, kFields.size()> group(const EpisodeRow& row) const {
    std::array<std::string, kFields.size()> values;
    for (std::size_t i = 0; i < kFields.size(); ++i) values[i] = contrast[i].value_or(row.*kFields[i].value);
    return values;
  }
};

Pairing pairing_of(const RowList& a, const RowList& b) {
  Pairing pairing;
  for (std::size_t i = 0; i < kFields.size(); ++i) {
    const std::set<std::string> of_a = values_of(a, kFields[i].value);
    const std::set<std::string> of_b = values_of(b, kFields[i].value);
    if (!disjoint(of_a, of_b)) continue;
    if (of_a.size() == 1 && of_b.size() == 1) {
      pairing.contrast[i] = fmt::format("{} vs {}", *of_a.begin(), *of_b.begin());
      continue;
    }
    throw InputError(
        fmt::format("nothing pairs: the {} of A is {}, that of B {}", kFields[i].name, listed(of_a), listed(of_b)));
  }
  return pairing;
}

std::set<std::string> episodes_of(const RowList& rows) {
  std::set<std::string> numbers;
  for (const EpisodeRow* row : rows) numbers.insert(fmt::format("{}", row->episode));
  return numbers;
}

[[noreturn]] void report_nothing_pairs(const RowList& a, const RowList& b) {
  const std::array<std::tuple<const char*, std::set<std::string>, std::set<std::string>>, 3> parts = {
      {{"tasks", values_of(a, &EpisodeRow::task), values_of(b, &EpisodeRow::task)},
       {"clips", values_of(a, &EpisodeRow::clip), values_of(b, &EpisodeRow::clip)},
       {"episodes", episodes_of(a), episodes_of(b)}}};
  for (const auto& [name, of_a, of_b] : parts) {
    if (!disjoint(of_a, of_b)) continue;
    throw InputError(fmt::format("nothing pairs: the {} of A are {}, those of B {}", name, listed(of_a), listed(of_b)));
  }
  throw InputError(
      "nothing pairs: A and B share engines, controllers, policies, perturbations, tasks, clips and episode numbers, "
      "but "
      "no combination of them");
}

RowList main_arm(const std::vector<EpisodeRow>& rows, const char* run) {
  RowList list;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm == "main") list.push_back(row);
  }
  if (list.empty()) throw InputError(fmt::format("nothing pairs: run {} has no episodes of the main arm", run));
  return list;
}

void require_comparable(const std::vector<EpisodeRow>& a, const std::vector<EpisodeRow>& b) {
  require_one_suite(a);
  require_one_suite(b);
  if (a.empty() || b.empty())
    throw InputError(fmt::format("nothing pairs: run {} has no episodes", a.empty() ? "A" : "B"));
  if (a.front().suite == b.front().suite && a.front().suite_version == b.front().suite_version) return;
  throw InputError(fmt::format("nothing pairs: A is of suite {}@{}, B of {}@{}", a.front().suite,
                               a.front().suite_version, b.front().suite, b.front().suite_version));
}

using Group = std::array<std::string, kFields.size()>;
using PairKey = std::pair<Group, EpisodeId>;

std::map<PairKey, const EpisodeRow*> indexed(const RowList& rows, const Pairing& pairing) {
  std::map<PairKey, const EpisodeRow*> index;
  for (const EpisodeRow* row : rows) {
    const auto [found, is_new] = index.try_emplace({pairing.group(*row), episode_id(*row)}, row);
    if (!is_new) require_distinct(*found->second, *row);
  }
  return index;
}

using Family = std::map<std::tuple<Group, int, std::string>, PairedRows>;  // group, place of the task, task

Family gather(const std::map<PairKey, const EpisodeRow*>& a, const std::map<PairKey, const EpisodeRow*>& b) {
  Family family;
  const auto both_levels = [&](const PairKey& key, const auto& action) {
    action(family[{key.first, task_rank(key.second.task), key.second.task}]);
    action(family[{key.first, task_rank("all"), "all"}]);
  };
  for (const auto& [key, row] : a) {
    const auto partner = b.find(key);
    both_levels(key, [&, of_a = row](PairedRows& gathered) {
      partner == b.end() ? void(++gathered.unpaired_a) : gathered.pairs.add(*of_a, *partner->second);
    });
  }
  for (const auto& [key, row] : b) {
    if (!a.contains(key)) both_levels(key, [](PairedRows& gathered) { ++gathered.unpaired_b; });
  }
  return family;
}

constexpr long kMostNeeded = 100'000'000;

// The smallest n for which the falling `detectable` is at most the difference.
template <typename Detectable>
long smallest_number(double difference, const Detectable& detectable) {
  require(difference > 0.0 && difference < 1.0, "difference: expected a number in (0, 1), found {}", difference);
  long too_few = 0, enough = 1;
  while (enough < kMostNeeded && detectable(enough) > difference) {
    too_few = enough;
    enough *= 2;
  }
  while (enough - too_few > 1) {
    const long middle = too_few + (enough - too_few) / 2;
    (detectable(middle) > difference ? too_few : enough) = middle;
  }
  return enough;
}

std::string interval_cell(const Estimate& estimate) {
  return fmt::format("[{:.1f}, {:.1f}]", 100.0 * estimate.interval.low, 100.0 * estimate.interval.high);
}

// "mujoco/vmc/dstar vs replay jitter_5cm hug"
std::string group_title(const Estimate& of) {
  const std::string condition = of.perturbation == "clean" ? "" : " " + of.perturbation;
  return fmt::format("{}/{}/{}{} {}", of.engine, of.controller, of.policy, condition, of.task);
}

long largest(const Estimates& comparisons, std::string_view name) {
  double value = 0.0;
  for (const Estimate& estimate : comparisons)
    if (estimate.name == name) value = std::max(value, estimate.value);
  return std::lround(value);
}

std::vector<std::string> comparison_notes(const Estimates& comparisons, double level, double margin) {
  const std::vector<PivotRow> rows = rows_of(comparisons, comparison_pivot(group_title).rows);
  std::vector<std::string> notes = {fmt::format(
      "Same episodes in both runs. A, B: success in %. A - B: points with Newcombe's paired {:g} % interval; by clip: "
      "bootstrap over clips, nowhere narrower than Newcombe's over so many clips. {} p (Holm): corrected for the {} "
      "comparisons here. MDE: the smallest difference, in points, that so many pairs with so much disagreement show in "
      "80 % of runs. Verdict: of A; the same within the margin where the interval by clip lies within {:g} points, "
      "else "
      "better or worse where p (Holm) is at most {:.2g}.",
      100.0 * level, kPairedTests, rows.size(), 100.0 * margin, 1.0 - level)};
  std::string small;
  for (const PivotRow& row : rows)
    if (row.value({.name = "clips"}) < kFewestClips)
      small.append(small.empty() ? "" : "; ").append(group_title(row.keys()));
  if (!small.empty())
    notes.push_back(fmt::format("Warning: fewer than {} clips in {}. A difference there is no finding by itself.",
                                kFewestClips, small));
  const long only_a = largest(comparisons, "unpaired_a"), only_b = largest(comparisons, "unpaired_b");
  if (only_a > 0 || only_b > 0)
    notes.push_back(fmt::format(
        "Warning: episodes without a partner are left out (in one group up to {} of A and {} of B).", only_a, only_b));
  for (const std::string& note : resolution_notes(comparisons, level, margin))
    notes.push_back(fmt::format("Caution: {}.", note));
  return notes;
}

}  // namespace

void add_comparison(const PairedRows& gathered, const IntervalOptions& options, const EstimatesOf& of) {
  const PairedTable& table = gathered.pairs.table();
  const long n = table.pairs();
  const auto share = [&](const char* name, long k) {
    of.rate(name, {.n = n, .k = k, .rate = static_cast<double>(k) / static_cast<double>(n)});
  };
  share("success_a", table.both + table.only_a);
  share("success_b", table.both + table.only_b);
  of.add("difference", n, table.difference(),
         newcombe_paired(table.both, table.only_a, table.only_b, table.neither, options.level));
  of.add("difference_by_clip", n, table.difference(), gathered.pairs.bootstrap(options));
  of.count("both", n, table.both);
  of.count("only_a", n, table.only_a);
  of.count("only_b", n, table.only_b);
  of.count("neither", n, table.neither);
  of.add("p", n, gathered.pairs.p());
  of.add("p_holm", n, std::nan(""));
  of.add("p_episodes", n, mcnemar_exact(table.only_a, table.only_b));
  of.count("clips", n, gathered.pairs.clips());
  const double discordance = static_cast<double>(table.only_a + table.only_b) / static_cast<double>(n);
  of.add("minimum_detectable", n, minimum_detectable_difference_paired(discordance, n, 1.0 - options.level));
  of.count("unpaired_a", {}, gathered.unpaired_a);
  of.count("unpaired_b", {}, gathered.unpaired_b);
  of.word("verdict", "");
}

SequentialDecision verdict_of(double difference, const Interval& interval, double p_holm, double level, double margin) {
  if (verdict_of(interval, margin) == SequentialDecision::kSame) return SequentialDecision::kSame;
  if (std::isnan(p_holm) || p_holm > 1.0 - level) return SequentialDecision::kUndecided;
  return difference > 0.0 ? SequentialDecision::kBetter : SequentialDecision::kWorse;
}

void judge_family(std::string_view difference, double level, double margin, Estimates& comparisons) {
  std::vector<double> p_values;
  for (const Estimate& estimate : comparisons)
    if (estimate.name == "p" && !std::isnan(estimate.value)) p_values.push_back(estimate.value);
  const std::vector<double> adjusted = holm(p_values);
  std::size_t next = 0;
  bool is_tested = false;
  double p_holm = std::nan("");
  const Estimate* judged = nullptr;
  for (Estimate& estimate : comparisons) {
    if (estimate.name == difference) judged = &estimate;
    if (estimate.name == "p") is_tested = !std::isnan(estimate.value);
    if (estimate.name == "p_holm") estimate.value = p_holm = is_tested ? adjusted[next++] : std::nan("");
    if (estimate.name == "verdict")
      estimate.text = to_string(is_tested ? verdict_of(judged->value, judged->interval, p_holm, level, margin)
                                          : SequentialDecision::kUndecided);
  }
}

Pivot comparison_pivot(std::string (*title)(const Estimate& keys)) {
  return {.title = "",
          .rows = {{"Comparison", &Estimate::policy, true, title},
                   {nullptr, &Estimate::engine},
                   {nullptr, &Estimate::controller},
                   {nullptr, &Estimate::perturbation},
                   {nullptr, &Estimate::task}},
          .columns = {column("Pairs", {.name = "difference"}, as_n), column("Clips", {.name = "clips"}, as_count),
                      column("A", {.name = "success_a"}, as_share), column("B", {.name = "success_b"}, as_share),
                      column("A - B", {.name = "difference"}, as_points),
                      column("by clip", {.name = "difference_by_clip"}, interval_cell),
                      column("only A", {.name = "only_a"}, as_count), column("only B", {.name = "only_b"}, as_count),
                      column("p", {.name = "p"}, as_p), column("p (Holm)", {.name = "p_holm"}, as_p),
                      column("McNemar p", {.name = "p_episodes"}, as_p),
                      column("MDE", {.name = "minimum_detectable"}, as_share),
                      column("Verdict", {.name = "verdict"}, as_word)}};
}

long needed_pairs(double discordance, double difference, double alpha) {
  return smallest_number(difference,
                         [&](long n) { return minimum_detectable_difference_paired(discordance, n, alpha); });
}

long needed_episodes(double rate, double difference, double alpha) {
  return smallest_number(difference, [&](long n) { return minimum_detectable_difference(rate, n, alpha); });
}

std::vector<std::string> resolution_notes(const Estimates& comparisons, double level, double margin) {
  std::vector<std::string> notes;
  for (const PivotRow& row : rows_of(comparisons, comparison_pivot(group_title).rows)) {
    const Estimate& detectable = *row.find({.name = "minimum_detectable"});
    const std::string_view undecided = to_string(SequentialDecision::kUndecided);
    if (detectable.value <= margin || row.find({.name = "verdict"})->text != undecided) continue;
    const double discordance =
        (row.value({.name = "only_a"}) + row.value({.name = "only_b"})) / static_cast<double>(*detectable.n);
    notes.push_back(fmt::format(
        "{}: {} pairs cannot resolve {:g} points; with so much disagreement about {} would (80 % of runs)",
        group_title(row.keys()), *detectable.n, 100.0 * margin, needed_pairs(discordance, margin, 1.0 - level)));
  }
  return notes;
}

std::vector<std::string> resolution_notes(const std::vector<LeaderboardEntry>& entries, double margin) {
  std::vector<std::string> notes;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || entry.arm == "null" || entry.n == 0) continue;
    const double alpha = 1.0 - entry.level;
    if (minimum_detectable_difference(entry.success, entry.n, alpha) <= margin) continue;
    notes.push_back(fmt::format(
        "{}/{}/{} {}: {} distinct episodes cannot resolve {:g} points to another arm; unpaired about {} would",
        entry.engine, entry.controller, entry.policy, entry.perturbation, entry.n, 100.0 * margin,
        needed_episodes(entry.success, margin, alpha)));
  }
  return notes;
}

Analysis comparison_analysis(const std::vector<EpisodeRow>& a, const std::vector<EpisodeRow>& b,
                             const IntervalOptions& options, double margin) {
  require_comparable(a, b);
  const RowList of_a = main_arm(a, "A");
  const RowList of_b = main_arm(b, "B");
  const Pairing pairing = pairing_of(of_a, of_b);
  Estimates comparisons;
  for (const auto& [key, gathered] : gather(indexed(of_a, pairing), indexed(of_b, pairing))) {
    if (gathered.pairs.table().pairs() == 0) continue;
    const auto& [group, rank, task] = key;
    const auto& [engine, controller, policy, perturbation] = group;
    add_comparison(
        gathered, options,
        {{.engine = engine, .controller = controller, .policy = policy, .perturbation = perturbation, .task = task},
         comparisons});
  }
  if (comparisons.empty()) report_nothing_pairs(of_a, of_b);
  judge_family("difference_by_clip", options.level, margin, comparisons);
  Analysis analysis{.name = "comparison", .title = "Comparison", .level = options.level};
  analysis.tables = {table_of(comparisons, comparison_pivot(group_title))};
  analysis.tables.front().notes = comparison_notes(comparisons, options.level, margin);
  EstimatesOf{{}, analysis.estimates}.add("margin", {}, margin);
  std::ranges::move(comparisons, std::back_inserter(analysis.estimates));
  return analysis;
}

}  // namespace duet
