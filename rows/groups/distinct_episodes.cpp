#include "duet/rows/groups/distinct_episodes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <string_view>
#include <tuple>
#include <utility>

#include "duet/rows/groups/row_groups.h"
#include "duet/rows/row_identity.h"

namespace duet {
namespace {

using Arms = std::tuple<std::string_view, std::string_view, std::string_view, std::string_view, std::string_view>;

Arms arms_of(const EpisodeRow& row) { return {row.engine, row.controller, row.policy, row.perturbation, row.arm}; }

bool repeats(const EpisodeRow& first, const EpisodeRow& other) {
  const std::vector<std::string> fields = differing_fields(first, other);
  return std::ranges::all_of(
      fields, [](const std::string& field) { return field == "key" || field == "episode" || field == "seed"; });
}

struct Distinct {
  std::vector<const EpisodeRow*> rows;
  std::map<Arms, int> repeated;  // how many are left out
};

// Rows of one clip by arms and state hash: what repeats is among them.
using SameStates = std::map<std::pair<Arms, std::string_view>, std::vector<const EpisodeRow*>>;

Distinct fold(const std::vector<EpisodeRow>& rows) {
  Distinct distinct;
  distinct.rows.reserve(rows.size());
  SameStates seen;
  const EpisodeRow* before = nullptr;
  for (const EpisodeRow* row : in_episode_order(rows)) {
    if (before != nullptr && (row->task != before->task || row->clip != before->clip)) seen.clear();
    before = row;
    std::vector<const EpisodeRow*>& same = seen[{arms_of(*row), row->state_hash}];
    const auto is_repeat = [&](const EpisodeRow* first) {
      return first->episode != row->episode && repeats(*first, *row);
    };
    if (!row->state_hash.empty() && std::ranges::any_of(same, is_repeat)) {
      ++distinct.repeated[arms_of(*row)];
      continue;
    }
    same.push_back(row);
    distinct.rows.push_back(row);
  }
  return distinct;
}

}  // namespace

std::vector<const EpisodeRow*> distinct_episodes(const std::vector<EpisodeRow>& rows) {
  require_one_suite(rows);
  return fold(rows).rows;
}

std::string repeats_note(const std::vector<EpisodeRow>& rows) {
  const Distinct distinct = fold(rows);
  if (distinct.repeated.empty()) return "";
  std::vector<std::string> groups;
  for (const auto& [combination, count] : distinct.repeated) {
    const auto& [engine, controller, policy, perturbation, arm] = combination;
    groups.push_back(fmt::format("{}/{}/{} {}: {}", engine, controller, policy, perturbation, count));
  }
  return fmt::format("{} of {} episodes repeat another one of their clip bit for bit and count once ({})",
                     rows.size() - distinct.rows.size(), rows.size(), fmt::join(groups, ", "));
}

}  // namespace duet
