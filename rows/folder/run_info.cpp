#include "duet/rows/folder/run_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr std::string_view kRunSchema = "duet.run/1";

using Names = std::vector<std::string>;
constexpr std::array<std::pair<const char*, Names EpisodeFilter::*>, 5> kPartKeys = {
    {{"engines", &EpisodeFilter::engines},
     {"controllers", &EpisodeFilter::controllers},
     {"policies", &EpisodeFilter::policies},
     {"tasks", &EpisodeFilter::tasks},
     {"perturbations", &EpisodeFilter::perturbations}}};

}  // namespace

template <>
const JsonSchema<EpisodeFilter>& json_schema<EpisodeFilter>() {
  static const JsonSchema<EpisodeFilter> schema = [] {
    JsonSchema<EpisodeFilter> keys;
    for (const auto& [key, names] : kPartKeys) keys.emplace_back(FieldDoc{.name = key, .optional = true}, names);
    return keys;
  }();
  return schema;
}

template <>
const JsonSchema<RunPlan>& json_schema<RunPlan>() {
  static const JsonSchema<RunPlan> schema = {
      {{"episodes"}, &RunPlan::episodes}, {{"asked"}, &RunPlan::asked}, {{"parts"}, &RunPlan::parts}};
  return schema;
}

template <>
const JsonSchema<RunInfo>& json_schema<RunInfo>() {
  using I = RunInfo;
  static const JsonSchema<I> schema = {{{"suite"}, &I::suite},
                                       {{"suite_version"}, &I::suite_version},
                                       {{"suite_hash"}, &I::suite_hash},
                                       {{"argv"}, &I::argv},
                                       {{"created_at"}, &I::created_at},
                                       {{"policies"}, &I::policies},
                                       {{"controllers"}, &I::controllers},
                                       {{.name = "certificate", .optional = true}, &I::certificate},
                                       {{.name = "plan", .optional = true}, &I::plan}};
  return schema;
}

std::vector<EpisodeFilter> with_part(std::vector<EpisodeFilter> parts, EpisodeFilter part) {
  for (const auto& [key, member] : kPartKeys) {
    Names& names = part.*member;
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
  }
  parts.push_back(std::move(part));
  if (std::any_of(parts.begin(), parts.end(), [](const EpisodeFilter& p) { return p.is_whole(); }))
    return {EpisodeFilter()};
  if (std::find(parts.begin(), parts.end() - 1, parts.back()) != parts.end() - 1) parts.pop_back();
  return parts;
}

// An argument may be no valid UTF-8; the run still counts.
std::string run_json(const RunInfo& info) { return dumped(json_document(kRunSchema, info), 2) + "\n"; }

RunInfo read_run_json(const std::string& path) { return read_document<RunInfo>(read_text(path), path, kRunSchema); }

std::string suite_label(const std::string& suite, const std::string& version, const std::string& hash) {
  return fmt::format("{}@{} ({})", suite, version, hash.substr(0, 12));
}

std::string suite_label(const RunInfo& info) { return suite_label(info.suite, info.suite_version, info.suite_hash); }

std::string short_digest(const std::string& digest) { return digest.empty() ? "absent" : digest.substr(0, 12); }

void IdentityCheck::add(const std::string& kind, const std::string& name, const std::string& digest,
                        const std::string& where) {
  const auto [found, is_new] = places_.try_emplace({kind, name}, Place{digest, where});
  const Place& first = found->second;
  if (is_new || first.digest == digest) return;
  throw InputError(fmt::format("{} '{}' is {} in {} and {} in {}: one name stands for one {}", kind, name,
                               short_digest(first.digest), first.where, short_digest(digest), where, kind));
}

void IdentityCheck::add(const EpisodeRow& row, const std::string& where) {
  add("policy", row.policy, row.policy_digest, where);
  add("controller", row.controller, row.controller_digest, where);
  const bool ran = row.outcome != Outcome::kUnsupported && !row.profile_digest.empty();
  if (ran) add("profile of engine", row.engine, row.profile_digest, where);
}

void IdentityCheck::add(const RunInfo& info, const std::string& where) {
  for (const auto& [name, digest] : info.policies)
    if (!digest.empty()) add("policy", name, digest, where);
  for (const auto& [name, digest] : info.controllers)
    if (!digest.empty()) add("controller", name, digest, where);
}

}  // namespace duet
