#include "duet/app/cli/run_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "duet/core/require.h"
#include "duet/execution/missing_tags.h"
#include "duet/policies/policy.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet::cli {
namespace {

// The text before and after each note.
struct Frame {
  const char *before, *after;
  bool at_end = false;
};

Frame frame_of(const std::string& format) {
  if (format == "md") return {"> ", "\n\n"};
  if (format == "csv") return {"# ", "\n"};
  if (format == "tex") return {"% ", "\n"};
  return {"<!-- ", " -->\n", true};  // svg: its first line has to be its own
}

// A policy that takes longer for a plan than the plan is for: the run waits for it, though no plan is late.
std::vector<std::string> slow_policy_notes(const std::vector<EpisodeRow>& rows) {
  constexpr double kPlanSeconds = kTicksPerPlan / 50.0;  // of the clock that policies are asked by
  std::map<std::string, std::vector<double>> seconds;
  for (const EpisodeRow& row : rows)
    if (std::isfinite(row.policy_ms.p50)) seconds[row.policy].push_back(row.policy_ms.p50 / 1e3);
  std::vector<std::string> notes;
  for (auto& [policy, plans] : seconds) {
    const auto middle = plans.begin() + std::ssize(plans) / 2;
    std::ranges::nth_element(plans, middle);
    if (*middle <= kPlanSeconds) continue;
    notes.push_back(
        fmt::format("policy '{}' takes {:.2g} s for a plan (median over {} episodes) and is asked for one every "
                    "{} s of an episode: most of the time of its episodes is its own",
                    policy, *middle, plans.size(), kPlanSeconds));
  }
  return notes;
}

}  // namespace

bool has_faults(const std::map<std::string, int>& outcomes) {
  return outcomes.contains("error") || outcomes.contains("timeout") || outcomes.contains("unsupported");
}

void warn_of_timeouts(const std::map<std::string, int>& outcomes) {
  const auto found = outcomes.find("timeout");
  if (found == outcomes.end()) return;
  warn(
      fmt::format("{} of the episodes passed `limits.wall_s_per_episode` and count as failures; the same command runs "
                  "them again",
                  found->second));
}

Run open_run(const std::string& path, RowExtent extent) {
  Run run = load_run(path, extent);
  add_missing_tags(run);
  for (const std::string& warning : run.warnings) warn(warning);
  return run;
}

std::vector<std::string> completeness_notes(const std::vector<std::string>& paths, const std::vector<Run>& runs) {
  std::vector<std::string> notes;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::string text = completeness(runs[i]);
    if (!text.empty()) notes.push_back(runs.size() > 1 ? fmt::format("{}: {}", paths[i], text) : text);
  }
  return notes;
}

void add_row_notes(const std::vector<EpisodeRow>& rows, std::vector<std::string>& notes) {
  for (std::string& slow : slow_policy_notes(rows)) notes.push_back(std::move(slow));
  const std::string repeats = repeats_note(rows);
  if (repeats.empty()) return;
  warn(repeats);
  notes.push_back(repeats);
}

std::vector<std::string> with_suite(const RankingSuite& suite, std::vector<std::string> notes) {
  if (!suite.warning.empty()) notes.insert(notes.begin(), suite.warning);
  return notes;
}

std::string with_notes(const std::string& format, const std::string& text, const std::vector<std::string>& notes) {
  if (notes.empty()) return text;
  if (format == "json") {
    nlohmann::json json = nlohmann::json::parse(text);
    nlohmann::json all = notes;
    for (nlohmann::json& own : json["notes"]) all.push_back(std::move(own));
    json["notes"] = std::move(all);
    return dumped(json, 2) + "\n";
  }
  const Frame frame = frame_of(format);
  std::string lines;
  for (const std::string& note : notes) lines += frame.before + note + frame.after;
  return frame.at_end ? text + lines : lines + text;
}

void require_whole(const Run& run, const std::string& path, bool allowed, const std::string& action) {
  if (allowed || !is_partial(run)) return;
  throw InputError(
      fmt::format("'{}': {}: run it to its end, or {} it with --partial", path, completeness(run), action));
}

}  // namespace duet::cli
