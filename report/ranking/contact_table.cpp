#include "duet/report/ranking/contact_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "duet/core/numbers.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr std::string_view kPrefix = "human.";
constexpr std::string_view kPeak = ".peak_n";
constexpr double kNoForce = std::numeric_limits<double>::quiet_NaN();

// The name that rows give a force of a region, and its estimate.
struct ContactForce {
  const char *ending, *name, *unit;
};
constexpr std::array<ContactForce, 7> kForces = {{{".peak_n", "peak", "N"},
                                                  {".quasi_static_n", "quasi_static", "N"},
                                                  {".transient_n", "transient", "N"},
                                                  {".settled_n", "settled", "N"},
                                                  {".impulse_ns", "impulse", "N s"},
                                                  {".pressure_n_cm2", "pressure", "N/cm^2"},
                                                  {".worst_ratio", "ratio", "1"}}};
using Forces = std::array<double, kForces.size()>;  // NaN: not measured
constexpr std::size_t kPeakForce = 0, kImpulse = 4, kRatio = 6;

Forces no_forces() {
  Forces forces;
  forces.fill(kNoForce);
  return forces;
}

double force_or_nan(const EpisodeRow& row, const std::string& name) {
  const auto found = row.forces.find(name);
  return found != row.forces.end() ? found->second : kNoForce;
}

// fmax: NaN gives way to a number.
void take_largest(const Forces& of, Forces& into) {
  for (std::size_t i = 0; i < of.size(); ++i) into[i] = std::fmax(into[i], of[i]);
}

// The contacts of one episode, by region.
using RegionForces = std::map<std::string, Forces>;

// The regions that the episode touched, and all of them together.
RegionForces touched_regions(const EpisodeRow& row) {
  RegionForces regions;
  Forces any = no_forces();
  double impulse = 0.0;
  for (const auto& [name, value] : row.forces) {
    if (!name.starts_with(kPrefix) || !name.ends_with(kPeak) || name.size() <= kPrefix.size() + kPeak.size()) continue;
    const std::string prefix = name.substr(0, name.size() - kPeak.size());
    Forces forces;
    for (std::size_t i = 0; i < forces.size(); ++i) forces[i] = force_or_nan(row, prefix + kForces[i].ending);
    take_largest(forces, any);
    if (std::isfinite(forces[kImpulse])) impulse += forces[kImpulse];
    regions[prefix.substr(kPrefix.size())] = forces;
  }
  if (regions.empty()) return regions;
  any[kImpulse] = impulse;
  regions[kAnyRegion] = any;
  return regions;
}

// The rank from the head down, as regions of the human body are called; others by name, the whole body last.
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

using TouchedEpisodes = std::vector<RegionForces>;

void add_region(const TouchedEpisodes& episodes, const EstimatesOf& of) {
  Forces largest = no_forces();
  std::vector<double> peaks;
  long over = 0;
  for (const RegionForces& episode : episodes) {
    const auto found = episode.find(of.keys.of);
    if (found == episode.end()) continue;
    over += found->second[kRatio] > 1.0 ? 1 : 0;
    take_largest(found->second, largest);
    peaks.push_back(found->second[kPeakForce]);
  }
  const auto n = static_cast<long>(episodes.size()), touched = static_cast<long>(peaks.size());
  of.count("touched", n, touched);
  of.count("over", n, over);
  for (std::size_t i = 0; i < kForces.size(); ++i) {
    of.add(kForces[i].name, touched, largest[i], kNoInterval, kForces[i].unit);
    if (i == kPeakForce) of.add("median_peak", touched, quantile(peaks, 0.5), kNoInterval, "N");
  }
}

struct ContactGroup {
  std::map<std::string, TouchedEpisodes> engines;
  long diverged = 0;  // of the episodes; what they measured until then counts
};

// Regions stand from the head down, the whole body last.
Estimates group_estimates(const std::string& controller, const std::string& policy, const ContactGroup& group) {
  Regions regions = {kAnyRegion};
  TouchedEpisodes all;
  for (const auto& [engine, episodes] : group.engines) {
    for (const RegionForces& episode : episodes)
      for (const auto& [region, forces] : episode) regions.insert(region);
    all.insert(all.end(), episodes.begin(), episodes.end());
  }
  Estimates estimates;
  EstimatesOf of{{.controller = controller, .policy = policy}, estimates};
  const auto add_engine = [&](const std::string& engine, const TouchedEpisodes& episodes) {
    of.keys.engine = engine;
    for (const std::string& region : regions) {
      of.keys.of = region;
      add_region(episodes, of);
    }
  };
  for (const auto& [engine, episodes] : group.engines) add_engine(engine, episodes);
  add_engine("all", all);
  of.keys.engine = of.keys.of = "";
  of.count("diverged", static_cast<long>(all.size()), group.diverged);
  return estimates;
}

std::string force_number(double value) { return short_number(value, 2); }

std::string ratio_cell(double ratio) { return fmt::format("{}{}", force_number(ratio), ratio > 1.0 ? "*" : ""); }

// The name under which a group's tables fold together.
std::string group_name(const Estimate& keys) {
  return fmt::format("Controller {}, policy {}", keys.controller, keys.policy);
}

std::string episodes_sentence(const ContactGroup& group) {
  const std::size_t first = group.engines.begin()->second.size();
  if (std::ranges::all_of(group.engines, [&](const auto& engine) { return engine.second.size() == first; }))
    return counted(static_cast<long>(first), "episode") + (group.engines.size() > 1 ? " in each engine" : "");
  std::string text = "episodes:";
  for (const auto& [engine, episodes] : group.engines)
    text += fmt::format("{} {} {}", text.ends_with(':') ? "" : ",", engine, episodes.size());
  return text;
}

TitledTable peak_table(const Estimates& estimates, const ContactGroup& group) {
  Pivot pivot{.title = "Peak force [N]", .rows = {{"Region", &Estimate::of, true}}, .columns = {}};
  for (const auto& [engine, episodes] : group.engines)
    pivot.columns.push_back({engine, [&engine = engine](const PivotRow& row) {
                               const std::string peak = force_number(row.value({.engine = engine, .name = "peak"}));
                               const double ratio = row.value({.engine = engine, .name = "ratio"});
                               return std::isfinite(ratio) ? fmt::format("{} ({})", peak, ratio_cell(ratio)) : peak;
                             }});
  if (group.diverged > 0)
    pivot.notes = {fmt::format("Of all episodes {} diverged; what they measured until then counts.", group.diverged)};
  TitledTable titled = table_of(estimates, pivot);
  titled.caption = fmt::format("{}; {}.", group_name(estimates.front()), episodes_sentence(group));
  return titled;
}

TitledTable other_table(const Estimates& estimates, bool several) {
  const auto of_all = [](const char* title, const char* name, CellText cell) {
    return column(title, {.engine = "all", .name = name}, std::move(cell));
  };
  const auto share = [](const Estimate& over) { return percent(over.value / static_cast<double>(*over.n)); };
  const auto touched = [](const Estimate& of) { return fmt::format("{} of {}", of.value, *of.n); };
  TitledTable titled = table_of(
      estimates,
      {.title = several ? "All engines together" : "Other figures",
       .rows = {{"Region", &Estimate::of, true}},
       .columns = {
           of_all("Touched", "touched", touched), of_all("Over limit [%]", "over", share),
           of_all("Ratio", "ratio", [](const Estimate& of) { return ratio_cell(of.value); }),
           of_all("Median peak [N]", "median_peak", as_short(2)), of_all("After 0.1 s [N]", "settled", as_short(2)),
           of_all("Quasi-static [N]", "quasi_static", as_short(2)), of_all("Transient [N]", "transient", as_short(2)),
           of_all("Pressure [N/cm^2]", "pressure", as_short(2)), of_all("Impulse [N s]", "impulse", as_short(2))}});
  titled.caption =
      fmt::format("{}{}.", group_name(estimates.front()), several ? "; an episode counts once in each engine" : "");
  return titled;
}

void add_group(const Estimates& estimates, const ContactGroup& group, Analysis& analysis) {
  for (TitledTable titled : {peak_table(estimates, group), other_table(estimates, group.engines.size() > 1)}) {
    titled.group = group_name(estimates.front());
    analysis.tables.push_back(std::move(titled));
  }
  analysis.estimates.insert(analysis.estimates.end(), estimates.begin(), estimates.end());
}

}  // namespace

bool has_solid_partner(const EpisodeRow& row) {
  const auto first = row.forces.lower_bound(std::string(kPrefix));
  return first != row.forces.end() && first->first.starts_with(kPrefix);
}

bool is_over_limit(const EpisodeRow& row) {
  const RegionForces regions = touched_regions(row);
  const auto any = regions.find(kAnyRegion);
  return any != regions.end() && any->second[kRatio] > 1.0;
}

Analysis contact_analysis(const std::vector<EpisodeRow>& rows, const std::string& arm) {
  std::map<std::pair<std::string, std::string>, ContactGroup> groups;  // by controller, policy
  std::map<std::tuple<std::string, std::string, std::string, std::string, EpisodeId>, const EpisodeRow*> seen;
  bool verified = true;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm != arm || row->engine == kPlaybackEngine || !has_solid_partner(*row)) continue;
    const auto [other, first] =
        seen.try_emplace({row->engine, row->controller, row->policy, row->perturbation, episode_id(*row)}, row);
    if (!first) require_distinct(*other->second, *row);
    ContactGroup& group = groups[{row->controller, row->policy}];
    group.engines[row->engine].push_back(touched_regions(*row));
    group.diverged += row->outcome == Outcome::kDiverged ? 1 : 0;
    verified = verified && force_or_nan(*row, "human.limits_verified") == 1.0;
  }
  Analysis analysis{.name = "contacts", .title = "Contact with people"};
  if (groups.empty()) {
    analysis.notes = {"No episode has contact forces with a solid partner."};
    return analysis;
  }
  if (verified)
    analysis.notes = {"Limits: verified"};
  else
    analysis.warning = "Limits: unverified (nobody has yet checked the table against ISO/TS 15066)";
  analysis.notes.insert(
      analysis.notes.end(),
      {"The impulse adds up magnitudes of region forces, so opposite pushes do not cancel; pressure is an estimate "
       "from how deep bodies overlap, not a measurement.",
       "Forces, pressure and impulse are the largest of any episode, the median is over the episodes that touched "
       "the region. In brackets, and as ratio: the largest of force and pressure over their limits, with an "
       "asterisk where a limit is exceeded; without brackets no limit is stated. Over limit: share of all episodes, "
       "touched or not. \"any\" is the whole body; regions that no episode touched are left out."});
  EstimatesOf{{}, analysis.estimates}.count("limits_verified", {}, verified ? 1 : 0);
  for (const auto& [name, group] : groups) add_group(group_estimates(name.first, name.second, group), group, analysis);
  return analysis;
}

}  // namespace duet
