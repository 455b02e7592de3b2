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

using nlohmann::json;

constexpr std::string_view kRunSchema = "duet.run/1";

using Names = std::vector<std::string>;
constexpr std::array<std::pair<const char*, Names EpisodeFilter::*>, 5> kPartKeys = {
    {{"engines", &EpisodeFilter::engines},
     {"controllers", &EpisodeFilter::controllers},
     {"policies", &EpisodeFilter::policies},
     {"tasks", &EpisodeFilter::tasks},
     {"perturbations", &EpisodeFilter::perturbations}}};

json to_json(const EpisodeFilter& part) {
  json object = json::object();
  for (const auto& [key, names] : kPartKeys)
    if (!(part.*names).empty()) object[key] = part.*names;
  return object;
}

json to_json(const RunPlan& plan) {
  json parts = json::array();
  for (const EpisodeFilter& part : plan.parts) parts.push_back(to_json(part));
  return {{"episodes", plan.episodes}, {"asked", plan.asked}, {"parts", std::move(parts)}};
}

Names read_names(JsonFields& fields, const std::string& key, const std::string& what) {
  const json& list = fields.at(key);
  Names names;
  if (!list.is_array()) throw InputError(fmt::format("{}: key '{}': expected a list", what, key));
  for (const json& word : list) {
    if (!word.is_string()) throw InputError(fmt::format("{}: key '{}': expected strings", what, key));
    names.push_back(word.get<std::string>());
  }
  return names;
}

EpisodeFilter read_part(const json& object, const std::string& what) {
  JsonFields fields(object, what);
  EpisodeFilter part;
  for (const auto& [key, names] : kPartKeys)
    if (fields.has(key)) part.*names = read_names(fields, key, what);
  fields.refuse_unknown();
  return part;
}

RunPlan read_plan(const json& object, const std::string& path) {
  const std::string what = path + ": key 'plan'";
  JsonFields fields(object, what);
  RunPlan plan;
  plan.episodes = fields.integer("episodes");
  plan.asked = fields.integer("asked");
  const json& parts = fields.at("parts");
  if (!parts.is_array()) throw InputError(fmt::format("{}: key 'parts': expected a list", what));
  for (const json& part : parts) plan.parts.push_back(read_part(part, what + ": a part"));
  fields.refuse_unknown();
  return plan;
}

std::map<std::string, std::string> read_digests(JsonFields& fields, const std::string& key, const std::string& path) {
  const json& digests = fields.at(key);
  const auto is_text = [](const json& value) { return value.is_string(); };
  if (!digests.is_object() || !std::all_of(digests.begin(), digests.end(), is_text))
    throw InputError(fmt::format("{}: key '{}': expected an object of names and digests", path, key));
  return digests.get<std::map<std::string, std::string>>();
}

json read_certificate(JsonFields& fields, const std::string& path) {
  if (!fields.has("certificate")) return nullptr;
  const json& certificate = fields.at("certificate");
  if (certificate.is_object()) return certificate;
  throw InputError(fmt::format("{}: key 'certificate': expected an object, found {}", path, certificate.type_name()));
}

}  // namespace

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

std::string run_json(const RunInfo& info) {
  json object = {{"schema", kRunSchema},
                 {"suite", info.suite},
                 {"suite_version", info.suite_version},
                 {"suite_hash", info.suite_hash},
                 {"argv", info.argv},
                 {"created_at", info.created_at},
                 {"policies", info.policies},
                 {"controllers", info.controllers}};
  if (!info.certificate.is_null()) object["certificate"] = info.certificate;
  if (info.plan) object["plan"] = to_json(*info.plan);
  // An argument may be no valid UTF-8; the run still counts.
  return dumped(object, 2) + "\n";
}

RunInfo read_run_json(const std::string& path) {
  const json object = parse_json(read_text(path), path);
  JsonFields fields(object, path);
  if (const std::string schema = fields.text("schema"); schema != kRunSchema)
    throw InputError(fmt::format("{}: expected schema {}, found {}", path, kRunSchema, excerpt(schema)));
  RunInfo info;
  info.suite = fields.text("suite");
  info.suite_version = fields.text("suite_version");
  info.suite_hash = fields.text("suite_hash");
  info.argv = read_names(fields, "argv", path);
  info.created_at = fields.text("created_at");
  info.policies = read_digests(fields, "policies", path);
  info.controllers = read_digests(fields, "controllers", path);
  info.certificate = read_certificate(fields, path);
  if (fields.has("plan")) info.plan = read_plan(fields.at("plan"), path);
  fields.refuse_unknown();
  return info;
}

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
