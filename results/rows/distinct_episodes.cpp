#include "duet/results/rows/distinct_episodes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "duet/results/rows/row_identity.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {
namespace {

using Arms = std::tuple<std::string, std::string, std::string, std::string, std::string>;
using StatesKey = std::tuple<Arms, std::string, std::string, std::string>;  // task, clip, state hash

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

Distinct fold(const std::vector<EpisodeRow>& rows) {
  Distinct distinct;
  std::map<StatesKey, std::vector<const EpisodeRow*>> seen;
  for (const EpisodeRow* row : in_episode_order(rows)) {
    std::vector<const EpisodeRow*>& same = seen[{arms_of(*row), row->task, row->clip, row->state_hash}];
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
