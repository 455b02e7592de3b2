// Two runs episode by episode: which configurations pair, the paired table of each task, interval, test and correction.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <tuple>

#include "duet/core/require.h"
#include "duet/report/ranking/comparison_parts.h"
#include "duet/rows/groups/distinct_episodes.h"
#include "duet/rows/groups/row_groups.h"

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

std::string group_name(const Group& group, const std::string& task) {
  const auto& [engine, controller, policy, perturbation] = group;
  const std::string condition = perturbation == "clean" ? "" : " " + perturbation;
  return fmt::format("{}/{}/{}{} {}", engine, controller, policy, condition, task);
}

}  // namespace

Comparison evaluate(const PairedRows& gathered, const IntervalOptions& options) {
  const PairedTable& table = gathered.pairs.table();
  Comparison result;
  result.pairs = table.pairs();
  result.both = table.both;
  result.only_a = table.only_a;
  result.only_b = table.only_b;
  result.neither = table.neither;
  result.difference = table.difference();
  result.interval = newcombe_paired(table.both, table.only_a, table.only_b, table.neither, options.level);
  result.cluster_interval = gathered.pairs.bootstrap(options);
  result.clips = gathered.pairs.clips();
  result.p = gathered.pairs.p();
  result.p_episodes = mcnemar_exact(table.only_a, table.only_b);
  const double discordance = static_cast<double>(table.only_a + table.only_b) / static_cast<double>(result.pairs);
  result.minimum_detectable = minimum_detectable_difference_paired(discordance, result.pairs, 1.0 - options.level);
  result.level = options.level;
  result.unpaired_a = gathered.unpaired_a;
  result.unpaired_b = gathered.unpaired_b;
  return result;
}

void correct_for_family(std::vector<Comparison>& comparisons) {
  std::vector<double> p_values;
  p_values.reserve(comparisons.size());
  for (const Comparison& comparison : comparisons) p_values.push_back(comparison.p);
  const std::vector<double> adjusted = holm(p_values);
  for (std::size_t i = 0; i < comparisons.size(); ++i) comparisons[i].p_holm = adjusted[i];
}

std::vector<Comparison> compare_runs(const std::vector<EpisodeRow>& a, const std::vector<EpisodeRow>& b,
                                     const IntervalOptions& options) {
  require_comparable(a, b);
  const RowList of_a = main_arm(a, "A");
  const RowList of_b = main_arm(b, "B");
  const Pairing pairing = pairing_of(of_a, of_b);
  std::vector<Comparison> comparisons;
  for (const auto& [key, gathered] : gather(indexed(of_a, pairing), indexed(of_b, pairing))) {
    if (gathered.pairs.table().pairs() == 0) continue;
    const auto& [group, rank, task] = key;
    Comparison& comparison = comparisons.emplace_back(evaluate(gathered, options));
    comparison.group = group_name(group, task);
    comparison.task = task;
    std::tie(comparison.engine, comparison.controller, comparison.policy, comparison.perturbation) =
        std::tie(group[0], group[1], group[2], group[3]);
  }
  if (comparisons.empty()) report_nothing_pairs(of_a, of_b);
  correct_for_family(comparisons);
  return comparisons;
}

}  // namespace duet
