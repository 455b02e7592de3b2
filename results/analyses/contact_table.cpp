#include "duet/results/analyses/contact_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "duet/core/order_statistics.h"
#include "duet/results/analyses/cross_engine.h"
#include "duet/results/rows/distinct_episodes.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {
namespace {

constexpr std::string_view kPrefix = "human.";
constexpr std::string_view kPeak = ".peak_n";

double force_or_nan(const EpisodeRow& row, const std::string& name) {
  const auto found = row.forces.find(name);
  return found != row.forces.end() ? found->second : RegionContacts::kNone;
}

// Of one episode.
using RegionForces = std::map<std::string, RegionContacts>;

RegionContacts region_forces(const EpisodeRow& row, const std::string& region) {
  const std::string prefix = std::string(kPrefix) + region;
  RegionContacts forces;
  forces.region = region;
  forces.peak = force_or_nan(row, prefix + ".peak_n");
  forces.quasi_static = force_or_nan(row, prefix + ".quasi_static_n");
  forces.transient = force_or_nan(row, prefix + ".transient_n");
  forces.impulse = force_or_nan(row, prefix + ".impulse_ns");
  forces.pressure_n_cm2 = force_or_nan(row, prefix + ".pressure_n_cm2");
  forces.ratio = force_or_nan(row, prefix + ".worst_ratio");
  return forces;
}

// fmax: NaN gives way to a number.
void take_largest(const RegionContacts& of, RegionContacts& into) {
  into.peak = std::fmax(into.peak, of.peak);
  into.quasi_static = std::fmax(into.quasi_static, of.quasi_static);
  into.transient = std::fmax(into.transient, of.transient);
  into.impulse = std::fmax(into.impulse, of.impulse);
  into.pressure_n_cm2 = std::fmax(into.pressure_n_cm2, of.pressure_n_cm2);
  into.ratio = std::fmax(into.ratio, of.ratio);
}

// The regions that the episode touched, and all of them together.
RegionForces touched_regions(const EpisodeRow& row) {
  RegionForces regions;
  RegionContacts any;
  double impulse = 0.0;
  for (const auto& [name, value] : row.forces) {
    if (!name.starts_with(kPrefix) || !name.ends_with(kPeak) || name.size() <= kPrefix.size() + kPeak.size()) continue;
    const std::string region = name.substr(kPrefix.size(), name.size() - kPrefix.size() - kPeak.size());
    const RegionContacts forces = region_forces(row, region);
    take_largest(forces, any);
    if (std::isfinite(forces.impulse)) impulse += forces.impulse;
    regions[region] = forces;
  }
  if (regions.empty()) return regions;
  any.impulse = impulse;
  regions[std::string(kAnyRegion)] = any;
  return regions;
}

// From the head down, as regions of the human body are called; others by name, the whole body last.
std::size_t region_rank(std::string_view region) {
  static constexpr std::array<std::string_view, 12> kRegions = {
      "head", "neck", "chest", "abdomen", "back", "pelvis", "upper_arm", "forearm", "hand", "thigh", "shin", "foot"};
  if (region == kAnyRegion) return kRegions.size() + 1;
  return static_cast<std::size_t>(std::find(kRegions.begin(), kRegions.end(), region) - kRegions.begin());
}

struct FromTheHeadDown {
  bool operator()(const std::string& a, const std::string& b) const {
    return std::pair(region_rank(a), std::string_view(a)) < std::pair(region_rank(b), std::string_view(b));
  }
};
using Regions = std::set<std::string, FromTheHeadDown>;

// The episodes of one engine.
using Episodes = std::vector<RegionForces>;

RegionContacts over_episodes(const Episodes& episodes, const std::string& region) {
  RegionContacts contacts;
  contacts.region = region;
  std::vector<double> peaks;
  for (const RegionForces& episode : episodes) {
    const auto found = episode.find(region);
    if (found == episode.end()) continue;
    ++contacts.touched;
    if (found->second.ratio > 1.0) ++contacts.over;
    take_largest(found->second, contacts);
    peaks.push_back(found->second.peak);
  }
  contacts.median_peak = quantile(std::move(peaks), 0.5);
  return contacts;
}

EngineContacts engine_contacts(const std::string& engine, const Episodes& episodes, const Regions& regions) {
  EngineContacts contacts{.engine = engine, .episodes = static_cast<long>(episodes.size()), .regions = {}};
  for (const std::string& region : regions) contacts.regions.push_back(over_episodes(episodes, region));
  return contacts;
}

ContactGroup contact_group(const std::map<std::string, Episodes>& engines) {
  Regions regions = {std::string(kAnyRegion)};
  Episodes all;
  for (const auto& [engine, episodes] : engines) {
    for (const RegionForces& episode : episodes) {
      for (const auto& [region, forces] : episode) regions.insert(region);
    }
    all.insert(all.end(), episodes.begin(), episodes.end());
  }
  ContactGroup group;
  for (const auto& [engine, episodes] : engines) group.engines.push_back(engine_contacts(engine, episodes, regions));
  group.all = engine_contacts("all", all, regions);
  return group;
}

}  // namespace

bool has_solid_partner(const EpisodeRow& row) {
  const auto first = row.forces.lower_bound(std::string(kPrefix));
  return first != row.forces.end() && first->first.starts_with(kPrefix);
}

bool is_over_limit(const EpisodeRow& row) {
  const RegionForces regions = touched_regions(row);
  const auto any = regions.find(std::string(kAnyRegion));
  return any != regions.end() && any->second.ratio > 1.0;
}

ContactTable contact_table(const std::vector<EpisodeRow>& rows, const std::string& arm) {
  std::map<std::pair<std::string, std::string>, std::map<std::string, Episodes>> groups;
  std::map<std::pair<std::string, std::string>, long> diverged;
  std::map<std::tuple<std::string, std::string, std::string, std::string, EpisodeId>, const EpisodeRow*> seen;
  ContactTable table;
  table.limits_verified = true;
  for (const EpisodeRow* distinct : distinct_episodes(rows)) {
    const EpisodeRow& row = *distinct;
    if (row.arm != arm || row.engine == kPlaybackEngine || !has_solid_partner(row)) continue;
    const auto [other, first] =
        seen.try_emplace({row.engine, row.controller, row.policy, row.perturbation, episode_id(row)}, &row);
    if (!first) require_distinct(*other->second, row);
    const std::pair group(row.controller, row.policy);
    groups[group][row.engine].push_back(touched_regions(row));
    if (row.outcome == Outcome::kDiverged) ++diverged[group];
    if (force_or_nan(row, "human.limits_verified") != 1.0) table.limits_verified = false;
  }
  for (const auto& [name, engines] : groups) {
    ContactGroup group = contact_group(engines);
    std::tie(group.controller, group.policy) = name;
    group.diverged = diverged[name];
    table.groups.push_back(std::move(group));
  }
  table.limits_verified = table.limits_verified && !table.groups.empty();
  return table;
}

}  // namespace duet
