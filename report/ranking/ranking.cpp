#include "duet/report/ranking/ranking.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "duet/report/ranking/policy_groups.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr double kLevel = 1e-9;  // rates of equal counts differ by rounding alone

struct RankingKey {
  std::string arm, controller, policy, perturbation;
  auto operator<=>(const RankingKey&) const = default;
};
using EpisodeEngines = std::map<EpisodeId, std::map<std::string, const EpisodeRow*>>;

RankingKey key_of(const RankingRow& row) { return {row.arm, row.controller, row.policy, row.perturbation}; }

// Rows of physics engines, or of playback where there is nothing else.
std::map<RankingKey, EpisodeEngines> board_groups(const std::vector<EpisodeRow>& rows) {
  const std::vector<const EpisodeRow*> distinct = distinct_episodes(rows);
  const auto is_physics = [](const EpisodeRow* row) { return row->engine != kPlaybackEngine; };
  const auto is_clean = [](const EpisodeRow* row) { return row->perturbation == kClean; };
  const bool physics = std::ranges::any_of(distinct, is_physics);
  const bool clean =
      std::ranges::any_of(distinct, [&](const EpisodeRow* row) { return is_physics(row) == physics && is_clean(row); });
  std::map<RankingKey, EpisodeEngines> groups;
  for (const EpisodeRow* row : distinct) {
    if (is_physics(row) != physics || is_clean(row) != clean) continue;
    const EpisodeRow*& place =
        groups[{row->arm, row->controller, row->policy, row->perturbation}][episode_id(*row)][row->engine];
    if (place != nullptr) require_distinct(*place, *row);
    place = row;
  }
  return groups;
}

void count_ends(const EpisodeEngines& episodes, RankingRow& row) {
  for (const auto& [id, engines] : episodes) {
    for (const auto& [engine, of] : engines) {
      row.fell += of->fell || of->outcome == Outcome::kFell ? 1 : 0;
      row.unfinished += of->outcome != Outcome::kOk && of->outcome != Outcome::kFell ? 1 : 0;
    }
  }
}

// Adds rates over the episodes that all engines of the group ran; n is 0 where there are none.
void add_rates(const EpisodeEngines& episodes, double level, RankingRow& row) {
  std::set<std::string> names;
  for (const auto& [id, engines] : episodes)
    for (const auto& [engine, of] : engines) names.insert(engine);
  std::map<std::string, SuccessByClip> rates;
  SuccessByClip means;
  for (const auto& [id, engines] : episodes) {
    if (engines.size() < names.size()) continue;
    double sum = 0.0;
    for (const auto& [engine, of] : engines) {
      const double success = headline_success(*of) ? 1.0 : 0.0;
      rates[engine].add(id, success);
      sum += success;
    }
    means.add(id, sum / static_cast<double>(engines.size()));
  }
  row.n = means.episodes();
  if (row.n == 0) return;
  row.mean = means.mean();
  row.interval = names.size() > 1 ? means.by_clip(level) : means.of_episodes(level);
  for (const auto& [engine, success] : rates)
    row.rates.push_back({engine, success.episodes(), success.successes(), success.mean(), success.of_episodes(level)});
}

// Success of the null arm over the episodes of both; NaN without any.
double null_rate(const EpisodeEngines& episodes, const EpisodeEngines* null) {
  long n = 0, k = 0;
  if (null == nullptr) return std::nan("");
  for (const auto& [id, engines] : episodes) {
    const auto same = null->find(id);
    if (same == null->end()) continue;
    for (const auto& [engine, of] : engines) {
      const auto found = same->second.find(engine);
      if (found == same->second.end()) continue;
      ++n;
      k += headline_success(*found->second) ? 1 : 0;
    }
  }
  return n == 0 ? std::nan("") : static_cast<double>(k) / static_cast<double>(n);
}

// The null policy; of several the first by name.
const EpisodeEngines* null_group(const std::map<RankingKey, EpisodeEngines>& groups, const RankingKey& of) {
  for (const auto& [key, episodes] : groups)
    if (key.arm == "null" && key.controller == of.controller && key.perturbation == of.perturbation) return &episodes;
  return nullptr;
}

void add_contact(const Estimates& contacts, RankingRow& row) {
  const auto of_any = [&](const char* name) {
    return find_estimate(
        contacts,
        {.engine = "all", .controller = row.controller, .policy = row.policy, .of = kAnyRegion, .name = name});
  };
  const Estimate* touched = of_any("touched");
  if (row.arm != "main" || touched == nullptr) return;
  row.contact = RankingContact{.episodes = *touched->n,
                               .touched = std::lround(touched->value),
                               .over = std::lround(of_any("over")->value),
                               .worst_ratio = of_any("ratio")->value};
}

RankingDifference difference_of(const std::map<RankingKey, EpisodeEngines>& groups, const RankingRow& a,
                                const RankingRow& b, double level) {
  const EpisodeEngines &of_a = groups.at(key_of(a)), &of_b = groups.at(key_of(b));
  EpisodePairs pairs;
  for (const auto& [id, engines] : of_a) {
    const auto same = of_b.find(id);
    if (same == of_b.end()) continue;
    for (const auto& [engine, row] : engines)
      if (const auto found = same->second.find(engine); found != same->second.end()) pairs.add(*row, *found->second);
  }
  RankingDifference result{.other = b.name(), .interval = kNoInterval};
  if (pairs.clips() == 0) return result;
  result.difference = pairs.table().difference();
  result.interval = pairs.by_clip(level);
  result.clips = pairs.clips();
  result.p = pairs.p();
  return result;
}

RankingSpread spread_of(const RankingRow& row, const EpisodeEngines& episodes) {
  const auto [low, high] = std::ranges::minmax_element(row.rates, {}, &EngineRate::rate);
  RankingSpread spread{.lowest = *low, .highest = *high};
  EpisodePairs pairs;
  for (const auto& [id, engines] : episodes)
    if (engines.size() == row.rates.size()) pairs.add(*engines.at(high->engine), *engines.at(low->engine));
  const auto count = static_cast<double>(row.rates.size());
  if (pairs.clips() > 0) spread.p = std::min(1.0, pairs.p() * count * (count - 1.0) / 2.0);
  return spread;
}

std::vector<std::string> engines_won_by_another(const std::vector<RankingRow>& rows) {
  std::vector<std::string> engines;
  for (const EngineRate& first : rows.front().rates) {
    const bool another = std::ranges::any_of(rows, [&](const RankingRow& row) {
      return std::ranges::any_of(row.rates, [&](const EngineRate& rate) {
        return rate.engine == first.engine && rate.rate > first.rate + kLevel;
      });
    });
    if (another) engines.push_back(first.engine);
  }
  return engines;
}

bool is_better(const RankingRow& a, const RankingRow& b) {
  return std::abs(a.mean - b.mean) > kLevel ? a.mean > b.mean : a.name() < b.name();
}

void rank(std::vector<RankingRow>& rows) {
  std::ranges::stable_sort(rows, is_better);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool level = i > 0 && std::abs(rows[i].mean - rows[i - 1].mean) <= kLevel;
    rows[i].rank = level ? rows[i - 1].rank : i + 1;
  }
}

// Where no policy competes, the controllers do, under what knows the motion.
void part_by_role(std::vector<RankingRow> all, Ranking& board) {
  const auto is = [](ArmRole role) { return [role](const RankingRow& row) { return row.role.role == role; }; };
  board.of_oracles = std::ranges::none_of(all, is(ArmRole::kCompetitor));
  const ArmRole ranked = board.of_oracles ? ArmRole::kOracle : ArmRole::kCompetitor;
  for (RankingRow& row : all) (row.role.role == ranked ? board.rows : board.references).push_back(std::move(row));
  rank(board.rows);
  std::ranges::stable_sort(board.references, [](const RankingRow& a, const RankingRow& b) {
    return a.role.role != b.role.role ? a.role.role > b.role.role : is_better(a, b);
  });
}

}  // namespace

std::string RankingRow::name() const {
  std::string text = fmt::format("{} with {}", controller, policy);
  if (perturbation != kClean) text += " under " + perturbation;
  return role.word.empty() ? text : fmt::format("{} ({})", text, role.word);
}

Told told(const RankingDifference& difference, double level) {
  if (difference.clips < kFewestClips) return Told::kTooFewClips;
  const bool test = difference.p <= 1.0 - level, interval = difference.interval.low > 0.0;
  if (difference.difference <= 0.0 || (!test && !interval)) return Told::kApart;
  return test && interval ? Told::kAhead : test ? Told::kTestAlone : Told::kIntervalAlone;
}

Ranking rank_policies(const std::vector<EpisodeRow>& rows, const Estimates& contacts, const RankingSuite& suite,
                      double level) {
  const std::map<RankingKey, EpisodeEngines> groups = board_groups(rows);
  std::vector<RankingRow> all;
  for (const auto& [key, episodes] : groups) {
    RankingRow row{
        .controller = key.controller, .policy = key.policy, .perturbation = key.perturbation, .arm = key.arm};
    row.role = role_of(key.arm, key.policy, suite.roles);
    add_rates(episodes, level, row);
    if (row.n == 0) continue;
    row.null_rate = null_rate(episodes, null_group(groups, key));
    count_ends(episodes, row);
    add_contact(contacts, row);
    all.push_back(std::move(row));
  }
  Ranking made{.suite = suite, .level = level};
  part_by_role(std::move(all), made);
  if (made.rows.empty()) return made;
  const RankingRow& first = made.rows.front();
  if (made.rows.size() > 1) {
    made.lead = difference_of(groups, first, made.rows[1], level);
    made.won_by_another = engines_won_by_another(made.rows);
  }
  const auto control = std::ranges::find_if(made.references, [&](const RankingRow& row) {
    return row.role.role == ArmRole::kControl && row.controller == first.controller &&
           row.perturbation == first.perturbation;
  });
  if (control != made.references.end()) made.lift = difference_of(groups, first, *control, level);
  if (first.rates.size() > 1) made.spread = spread_of(first, groups.at(key_of(first)));
  return made;
}

}  // namespace duet
