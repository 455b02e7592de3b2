// Rows by policy, for the tables of policy experiments: one group per (engine, controller, arm, policy), its episodes
// by perturbation. The null arm is no policy, and episodes that could not run say nothing of one: both are left out.
#pragma once

#include <compare>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/results/analyses/cross_engine_tables.h"
#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {

struct PolicyTableOptions {
  double level = 0.95;
  int resamples = 10000;
  std::uint64_t seed = 1;
};

inline constexpr std::string_view kClean = "clean";

struct PolicyKey {
  std::string engine, controller, arm, policy;  // arms in the order main, shuffled
  auto operator<=>(const PolicyKey&) const = default;
};

using EpisodeRows = std::map<EpisodeId, const EpisodeRow*>;
using PerturbedRows = std::map<std::string, EpisodeRows, std::less<>>;

// Keeps pointers into `rows`. Throws InputError: rows of two suites or suite versions, an episode that is there twice.
std::map<PolicyKey, PerturbedRows> rows_of_policies(const std::vector<EpisodeRow>& rows);

// A share of episodes with its Wilson interval.
struct Rate {
  long n = 0, k = 0;
  double rate = std::numeric_limits<double>::quiet_NaN();  // NaN where n is 0
  Interval interval = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
};
Rate make_rate(long k, long n, double level);

// Over episodes: the headline; a detector by name ("paper", "paper"), n = 0 where no episode has its verdict. As in the
// leaderboard an episode without the verdict has failed where others have it.
Rate headline_rate(const EpisodeRows& rows, double level);
Rate verdict_rate(const EpisodeRows& rows, std::string_view version, std::string_view thresholds, double level);

// Success of `a` minus that of `b` over the episodes of both.
struct PairedDifference {
  long pairs = 0;
  double difference = std::numeric_limits<double>::quiet_NaN();
  Interval interval = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};  // Newcombe
};
PairedDifference paired_difference(const EpisodeRows& a, const EpisodeRows& b, double level);

std::string policy_name(const PolicyKey& key);  // "dstar", "dstar_shuffled (shuffled arm)"

// Columns "Engine" and "Controller" as far as they differ, and "Policy"; the rest in the caption.
RowLabels policy_labels(const std::vector<PolicyKey>& keys);
template <typename Entry>  // with a `key`
RowLabels labels_of(const std::vector<Entry>& entries) {
  std::vector<PolicyKey> keys;
  keys.reserve(entries.size());
  for (const Entry& entry : entries) keys.push_back(entry.key);
  return policy_labels(keys);
}

// A table with these labels and no other column yet.
TitledTable labelled_table(const std::string& title, const RowLabels& labels);
// Appends a row of the paper with `name` in the last column of labels.
std::vector<std::string>& add_paper_row(const std::string& name, TitledTable& titled);

std::string rate_cell(const Rate& rate);  // "84.9 [77.6, 90.1]", "-" without episodes
std::string tables_markdown(const std::vector<TitledTable>& tables);
std::string tables_latex(const std::vector<TitledTable>& tables);

inline constexpr Interval kNoInterval = {std::numeric_limits<double>::quiet_NaN(),
                                         std::numeric_limits<double>::quiet_NaN()};

// CSV with one figure a line, not rounded. `about`: what the figure is of besides its policy ("task", "perturbation").
TextTable figure_lines(const std::string& about);
void add_figure_line(const char* source, const PolicyKey& key, const std::string& about, std::string_view figure,
                     long n, double value, const Interval& interval, TextTable& lines);

nlohmann::json json_of(const Rate& rate);
nlohmann::json json_of(const PolicyKey& key);

}  // namespace duet
