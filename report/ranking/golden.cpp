#include "duet/report/ranking/golden.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "duet/core/require.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

constexpr const char* kGoldenSchema = "duet.golden/1";
// A mean over episodes moves by this much between processors (vector width, library versions), far less than a change
// of behaviour moves it. The keeper of a baseline edits the file where a figure needs another tolerance.
constexpr double kMetricRtol = 0.02;
constexpr double kMetricAtol = 1e-9;

struct GoldenFigure {
  double value = 0.0, atol = 0.0, rtol = 0.0;
  [[nodiscard]] double tolerance() const { return atol + rtol * std::abs(value); }
};

std::string place(const LeaderboardEntry& entry) {
  const std::string arm = entry.arm == "main" ? "" : fmt::format(" ({} arm)", entry.arm);
  return fmt::format("{}/{}/{}{} {} {}", entry.engine, entry.controller, entry.policy, arm, entry.perturbation,
                     entry.task);
}

// Everything that a baseline holds of an entry, by name.
std::map<std::string, GoldenFigure> figures_of(const LeaderboardEntry& entry) {
  std::map<std::string, GoldenFigure> figures;
  figures["episodes"] = {.value = static_cast<double>(entry.n)};
  // One episode of many may fall on the other side of a threshold on another processor.
  const double one_episode = entry.n >= kFewEpisodes ? 1.0 / static_cast<double>(entry.n) + 1e-12 : 1e-12;
  figures["success"] = {.value = entry.success, .atol = one_episode};
  for (const auto& [name, mean] : entry.metrics) {
    if (std::isfinite(mean)) figures[name] = {.value = mean, .atol = kMetricAtol, .rtol = kMetricRtol};
  }
  return figures;
}

using GoldenEntries = std::map<std::string, std::map<std::string, GoldenFigure>>;

struct Baseline {
  RunInfo run;
  GoldenEntries entries;
};

}  // namespace

template <>
const JsonSchema<GoldenFigure>& json_schema<GoldenFigure>() {
  using F = GoldenFigure;
  static const JsonSchema<F> schema = {{finite_key("value"), &F::value},
                                       {{.name = "atol", .range = {.low = 0.0}}, &F::atol},
                                       {{.name = "rtol", .range = {.low = 0.0}}, &F::rtol}};
  return schema;
}

template <>
const JsonSchema<Baseline>& json_schema<Baseline>() {
  using I = RunInfo;
  static const JsonSchema<Baseline> schema = [] {
    JsonSchema<Baseline> keys = json_keys<Baseline, I>(&Baseline::run, {{{"suite"}, &I::suite},
                                                                        {{"suite_version"}, &I::suite_version},
                                                                        {{"suite_hash"}, &I::suite_hash},
                                                                        {{"suite_yaml"}, &I::suite_yaml}});
    keys.emplace_back(FieldDoc{"entries"}, &Baseline::entries);
    return keys;
  }();
  return schema;
}

namespace {

// The lines of suite.yaml that the suite hash covers: all but policies, engines and comments.
std::set<std::string> hashed_lines(const std::string& yaml) {
  std::set<std::string> lines;
  for (std::size_t begin = 0; begin < yaml.size();) {
    const std::size_t end = std::min(yaml.find('\n', begin), yaml.size());
    const std::string line = yaml.substr(begin, end - begin);
    const bool hashed = !line.starts_with('#') && !line.starts_with("policies:") && !line.starts_with("engines:");
    if (hashed) lines.insert(line);
    begin = end + 1;
  }
  return lines;
}

// "start_radius: 1" for lines that only the first has.
std::string lines_without(const std::set<std::string>& first, const std::set<std::string>& second) {
  std::vector<std::string> only;
  std::ranges::set_difference(first, second, std::back_inserter(only));
  return only.empty() ? "nothing" : fmt::format("'{}'", fmt::join(only, "', '"));
}

void require_suite(const RunInfo& expected, const RunInfo& found, const std::string& what) {
  if (expected.suite != found.suite || expected.suite_version != found.suite_version)
    throw InputError(fmt::format("{}: is of suite {}@{}, the run of {}@{}", what, expected.suite,
                                 expected.suite_version, found.suite, found.suite_version));
  if (expected.suite_hash == found.suite_hash) return;
  const std::set<std::string> theirs = hashed_lines(expected.suite_yaml), ours = hashed_lines(found.suite_yaml);
  const std::string differing =
      theirs == ours ? "the suites say the same: clips, limits, robots or detectors differ"
                     : fmt::format("expected {}, found {}", lines_without(theirs, ours), lines_without(ours, theirs));
  throw InputError(fmt::format("{}: is of {}@{} with the suite hash {:.12}, the run's is {:.12}: {}", what,
                               expected.suite, expected.suite_version, expected.suite_hash, found.suite_hash,
                               differing));
}

GoldenEntries read_baseline(const std::string& text, const RunInfo& run) {
  const std::string what = "golden baseline";
  auto baseline = read_document<Baseline>(text, what, kGoldenSchema);
  require_suite(baseline.run, run, what);
  return std::move(baseline.entries);
}

// Shortens "mujoco/vmc/replay clean hug" part by part to the names of what may be missing as a whole.
std::string policy_of(const std::string& where) {
  const std::size_t begin = where.find('/', where.find('/') + 1) + 1;
  return where.substr(begin, where.find(' ', begin) - begin);
}
std::string combination_of(const std::string& where) { return where.substr(0, where.rfind(' ')); }

// The part of the run that is missing: a whole policy, its combination with an engine and a controller, or a task.
std::string missing_part(const std::string& where, const GoldenEntries& found) {
  const auto has = [&](const auto& name_of, const std::string& name) {
    return std::ranges::any_of(found, [&](const auto& entry) { return name_of(entry.first) == name; });
  };
  if (!has(policy_of, policy_of(where))) return fmt::format("policy '{}'", policy_of(where));
  if (!has(combination_of, combination_of(where))) return combination_of(where);
  return where;
}

void add_missing(const std::string& part, std::size_t figures, std::vector<GoldenDifference>& differences) {
  const auto same = std::ranges::find(differences, part, &GoldenDifference::where);
  if (same != differences.end()) {
    same->figures += static_cast<int>(figures);
    return;
  }
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  differences.push_back({.where = part,
                         .expected = kNone,
                         .found = kNone,
                         .tolerance = kNone,
                         .missing = true,
                         .figures = static_cast<int>(figures)});
}

}  // namespace

std::string bless(const std::vector<LeaderboardEntry>& entries, const RunInfo& run) {
  Baseline baseline{run, {}};
  for (const LeaderboardEntry& entry : entries) baseline.entries[place(entry)] = figures_of(entry);
  return dumped(json_document(kGoldenSchema, baseline), 2) + "\n";
}

std::vector<GoldenDifference> check(const std::string& golden_json, const std::vector<LeaderboardEntry>& entries,
                                    const RunInfo& run_info) {
  GoldenEntries found;
  for (const LeaderboardEntry& entry : entries) found[place(entry)] = figures_of(entry);
  std::vector<GoldenDifference> differences;
  for (const auto& [where, figures] : read_baseline(golden_json, run_info)) {
    const auto entry = found.find(where);
    if (entry == found.end()) {
      add_missing(missing_part(where, found), figures.size(), differences);
      continue;
    }
    const std::map<std::string, GoldenFigure>& run = entry->second;
    for (const auto& [name, figure] : figures) {
      GoldenDifference difference{.where = fmt::format("{} {}", where, name),
                                  .expected = figure.value,
                                  .found = std::numeric_limits<double>::quiet_NaN(),
                                  .tolerance = figure.tolerance(),
                                  .missing = true};
      if (const auto value = run.find(name); value != run.end()) {
        difference.found = value->second.value;
        difference.missing = false;
      }
      const bool agrees = std::abs(difference.found - difference.expected) <= difference.tolerance;
      if (!agrees) differences.push_back(std::move(difference));
    }
  }
  return differences;
}

std::vector<std::string> exact_differences(const Run& baseline, const Run& run) {
  require_suite(baseline.info, run.info, fmt::format("'{}'", baseline.path));
  std::map<std::string, const EpisodeRow*> rows;
  for (const EpisodeRow& row : run.rows) rows[row.key] = &row;
  std::vector<std::string> sentences;
  for (const EpisodeRow& row : baseline.rows) {
    const std::string where = fmt::format("{} {} of {}/{}/{} {}", row.clip, row.episode, row.engine, row.controller,
                                          row.policy, row.perturbation);
    const auto found = rows.find(row.key);
    if (found == rows.end()) {
      sentences.push_back(where + ": not in the run");
    } else if (const auto differences = row_differences(row, *found->second); !differences.empty()) {
      sentences.push_back(fmt::format("{}: expected, found: {}", where, differences_text(differences)));
    }
  }
  return sentences;
}

}  // namespace duet
