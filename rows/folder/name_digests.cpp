#include "duet/rows/folder/name_digests.h"

#include <fmt/format.h>

#include "duet/core/require.h"

namespace duet {

std::string short_digest(const std::string& digest) { return digest.empty() ? "absent" : digest.substr(0, 12); }

void NameDigests::add(const std::string& kind, const std::string& name, const std::string& digest,
                      const std::string& where) {
  const auto [found, is_new] = places_.try_emplace({kind, name}, Place{digest, where});
  const Place& first = found->second;
  if (is_new || first.digest == digest) return;
  throw InputError(fmt::format("{} '{}' is {} in {} and {} in {}: one name stands for one {}", kind, name,
                               short_digest(first.digest), first.where, short_digest(digest), where, kind));
}

void NameDigests::add(const EpisodeRow& row, const std::string& where) {
  add("policy", row.policy, row.policy_digest, where);
  add("controller", row.controller, row.controller_digest, where);
  const bool ran = row.outcome != Outcome::kUnsupported && !row.profile_digest.empty();
  if (ran) add("profile of engine", row.engine, row.profile_digest, where);
}

void NameDigests::add(const RunInfo& info, const std::string& where) {
  for (const auto& [name, digest] : info.policies)
    if (!digest.empty()) add("policy", name, digest, where);
  for (const auto& [name, digest] : info.controllers)
    if (!digest.empty()) add("controller", name, digest, where);
}

}  // namespace duet
