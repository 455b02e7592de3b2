#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "duet/core/require.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/merge/row_merge.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

void require_one_suite(const std::vector<Run>& runs) {
  for (const Run& run : runs) {
    const RunInfo &first = runs.front().info, &info = run.info;
    if (info.suite_hash == first.suite_hash && info.suite == first.suite) continue;
    throw InputError(
        fmt::format("'{}' is a run of {} {} ({:.8}), '{}' of {} {} ({:.8}): results of different suites are not mixed",
                    runs.front().path, first.suite, first.suite_version, first.suite_hash, run.path, info.suite,
                    info.suite_version, info.suite_hash));
  }
}

void require_one_digest(const std::vector<Run>& runs) {
  IdentityCheck digests;
  for (const Run& run : runs) {
    digests.add(run.info, run.path);
    for (const EpisodeRow& row : run.rows) digests.add(row, run.path);
  }
}

// A digest that one of the runs knows.
void add_digests(const std::map<std::string, std::string>& more, std::map<std::string, std::string>& digests) {
  for (const auto& [name, digest] : more)
    if (std::string& known = digests[name]; known.empty()) known = digest;
}

// Each once, in the order of their texts; one that is a union already is taken apart.
nlohmann::json environments_of(const std::vector<Run>& runs) {
  std::map<std::string, nlohmann::json> distinct;
  for (const Run& run : runs) {
    nlohmann::json environment = run.info.environment;
    if (!environment.is_object()) continue;
    if (const auto others = environment.find("others"); others != environment.end() && others->is_array())
      for (const nlohmann::json& other : *others) distinct[dumped(other)] = other;
    environment.erase("others");
    distinct[dumped(environment)] = environment;
  }
  if (distinct.empty()) return nullptr;
  nlohmann::json first = distinct.begin()->second;
  for (auto other = std::next(distinct.begin()); other != distinct.end(); ++other)
    first["others"].push_back(other->second);
  return first;
}

// A part of all policies was of those that the run's own suite has.
EpisodeFilter of_own_policies(EpisodeFilter part, const RunInfo& info) {
  if (part.policies.empty())
    for (const auto& [name, digest] : info.policies)
      if (name != "null") part.policies.push_back(name);
  return part;
}

// The most incomplete run decides what is missing of them all; how many episodes the parts have together is known
// when the suite is planned again.
std::optional<RunPlan> plan_of(const std::vector<Run>& runs, const std::vector<std::int64_t>& rows_of_each,
                               std::int64_t rows) {
  RunPlan plan;
  std::int64_t missing = 0, not_asked = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Run& run = runs[i];
    if (!run.info.plan) return std::nullopt;
    const RunPlan& own = *run.info.plan;
    missing = std::max(missing, own.asked - rows_of_each[i]);
    not_asked = std::max(not_asked, own.episodes - own.asked);
    for (const EpisodeFilter& part : own.parts)
      plan.parts = with_part(std::move(plan.parts), of_own_policies(part, run.info));
  }
  std::ranges::sort(plan.parts, {}, [](const EpisodeFilter& part) {
    return std::tie(part.engines, part.controllers, part.policies, part.tasks, part.perturbations);
  });
  plan.asked = rows + missing;
  plan.episodes = plan.asked + not_asked;
  return plan;
}

RunInfo info_of(const std::vector<Run>& runs) {
  RunInfo info = runs.front().info;
  info.environment = environments_of(runs);
  for (const Run& run : runs) {
    info.created_at = std::min(info.created_at, run.info.created_at);
    add_digests(run.info.policies, info.policies);
    add_digests(run.info.controllers, info.controllers);
    const nlohmann::json& certificate = run.info.certificate;
    if (certificate.is_null()) continue;
    if (info.certificate.is_null() || dumped(certificate) < dumped(info.certificate)) info.certificate = certificate;
  }
  return info;
}

// Wall times are all that equal rows differ in; the earlier row stays.
bool is_earlier(const EpisodeRow& a, const EpisodeRow& b) {
  return std::pair(a.started_at, dumped(to_json(a))) < std::pair(b.started_at, dumped(to_json(b)));
}

auto place_of(const EpisodeRow& row) {
  return std::tie(row.engine, row.controller, row.perturbation, row.arm, row.policy, row.task, row.clip, row.episode);
}

struct Origin {
  EpisodeRow row;
  std::string run;
};

void add_row(const EpisodeRow& row, const std::string& run, std::map<std::string, Origin>& rows, MergedRuns& result) {
  const auto [found, is_new] = rows.try_emplace(row.key, Origin{row, run});
  if (is_new) return;
  Origin& first = found->second;
  const Stands stands = which_stands(first.row.outcome, row.outcome);
  if (stands == Stands::kFirst || stands == Stands::kSecond) {
    ++result.superseded;
    if (stands == Stands::kSecond) first = {row, run};
    return;
  }
  const std::vector<FieldDifference> differences = row_differences(first.row, row);
  if (stands == Stands::kBothAgreed && !differences.empty()) {
    result.conflicts.push_back(fmt::format("{} {} of {}/{}/{} {} is not the same in '{}' and '{}': {}", row.clip,
                                           row.episode, row.engine, row.controller, row.policy, row.perturbation,
                                           first.run, run, differences_text(differences)));
    return;
  }
  ++result.folded;
  if (is_earlier(row, first.row)) first = {row, run};
}

}  // namespace

namespace {

// Unites a single run, whose rows are distinct.
Run united_alone(Run run) {
  std::vector<EpisodeRow> rows = std::move(run.rows);
  const auto count = static_cast<std::int64_t>(rows.size());
  run.rows.clear();
  run.info = united_info({run}, {count}, count);
  std::ranges::sort(rows, [](const EpisodeRow& a, const EpisodeRow& b) { return place_of(a) < place_of(b); });
  run.rows = std::move(rows);
  return run;
}

}  // namespace

MergedRuns merge_loaded(const std::vector<Run>& runs) {
  require(!runs.empty(), "expected a run at least, found none");
  require_one_suite(runs);
  require_one_digest(runs);
  MergedRuns result;
  result.run.path = runs.front().path;
  result.run.info = info_of(runs);
  std::map<std::string, Origin> rows;
  for (const Run& run : runs) {
    result.run.dropped_lines += run.dropped_lines;
    result.run.warnings.insert(result.run.warnings.end(), run.warnings.begin(), run.warnings.end());
    for (const EpisodeRow& row : run.rows) add_row(row, run.path, rows, result);
  }
  for (auto& [key, origin] : rows) result.run.rows.push_back(std::move(origin.row));
  std::ranges::sort(result.run.rows,
                    [](const EpisodeRow& a, const EpisodeRow& b) { return place_of(a) < place_of(b); });
  std::vector<std::int64_t> rows_of_each;
  for (const Run& run : runs) rows_of_each.push_back(static_cast<std::int64_t>(run.rows.size()));
  result.run.info.plan = plan_of(runs, rows_of_each, static_cast<std::int64_t>(result.run.rows.size()));
  return result;
}

nlohmann::json united_environment(const std::vector<Run>& runs) { return environments_of(runs); }

RunInfo united_info(const std::vector<Run>& runs, const std::vector<std::int64_t>& rows_of_each, std::int64_t rows) {
  require(!runs.empty() && runs.size() == rows_of_each.size(), "expected a run at least, and its number of rows");
  require_one_suite(runs);
  require_one_digest(runs);
  RunInfo info = info_of(runs);
  info.plan = plan_of(runs, rows_of_each, rows);
  return info;
}

Run united(std::vector<Run> runs) {
  require(!runs.empty(), "expected a run at least, found none");
  if (runs.size() == 1) return united_alone(std::move(runs.front()));
  MergedRuns result = merge_loaded(runs);
  if (!result.conflicts.empty())
    throw InputError(fmt::format("{} ({} such {})", result.conflicts.front(), result.conflicts.size(),
                                 result.conflicts.size() == 1 ? "episode" : "episodes"));
  return std::move(result.run);
}

}  // namespace duet
