#include "duet/report/ranking/contact_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "duet/core/order_statistics.h"
#include "duet/report/tables/cells.h"
#include "duet/rows/groups/distinct_episodes.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr std::string_view kPrefix = "human.";
constexpr std::string_view kPeak = ".peak_n";

double force_or_nan(const EpisodeRow& row, const std::string& name) {
  const auto found = row.forces.find(name);
  return found != row.forces.end() ? found->second : RegionContacts::kNone;
}

// The contacts of one episode, by region.
using RegionForces = std::map<std::string, RegionContacts>;

RegionContacts region_forces(const EpisodeRow& row, const std::string& region) {
  const std::string prefix = std::string(kPrefix) + region;
  RegionContacts forces;
  forces.region = region;
  forces.peak = force_or_nan(row, prefix + ".peak_n");
  forces.quasi_static = force_or_nan(row, prefix + ".quasi_static_n");
  forces.transient = force_or_nan(row, prefix + ".transient_n");
  forces.settled = force_or_nan(row, prefix + ".settled_n");
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
  into.settled = std::fmax(into.settled, of.settled);
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

std::string force_number(double value) { return short_number(value, 2); }

std::string ratio_cell(double ratio) { return fmt::format("{}{}", force_number(ratio), ratio > 1.0 ? "*" : ""); }

std::string peak_cell(const RegionContacts& contacts) {
  if (!std::isfinite(contacts.ratio)) return force_number(contacts.peak);
  return fmt::format("{} ({})", force_number(contacts.peak), ratio_cell(contacts.ratio));
}

// The name under which a group's tables fold together.
std::string contact_group_name(const ContactGroup& group) {
  return fmt::format("Controller {}, policy {}", group.controller, group.policy);
}

std::string episodes_sentence(const ContactGroup& group) {
  const long first = group.engines.front().episodes;
  if (std::all_of(group.engines.begin(), group.engines.end(),
                  [&](const EngineContacts& engine) { return engine.episodes == first; })) {
    return fmt::format("{} {}{}", first, first == 1 ? "episode" : "episodes",
                       group.engines.size() > 1 ? " in each engine" : "");
  }
  std::string text = "episodes:";
  for (const EngineContacts& engine : group.engines) {
    text += fmt::format("{} {} {}", text.ends_with(':') ? "" : ",", engine.engine, engine.episodes);
  }
  return text;
}

TitledTable peak_table(const ContactGroup& group) {
  TitledTable titled{.title = "Peak force [N]",
                     .caption = fmt::format("{}; {}.", contact_group_name(group), episodes_sentence(group)),
                     .table = {.header = {"Region"}, .rows = {}, .label_columns = 1}};
  for (const EngineContacts& engine : group.engines) titled.table.header.push_back(engine.engine);
  for (std::size_t i = 0; i < group.all.regions.size(); ++i) {
    std::vector<std::string> cells = {group.all.regions[i].region};
    for (const EngineContacts& engine : group.engines) cells.push_back(peak_cell(engine.regions[i]));
    titled.table.rows.push_back(std::move(cells));
  }
  if (group.diverged > 0) {
    titled.notes.push_back(
        fmt::format("Of all episodes {} diverged; what they measured until then counts.", group.diverged));
  }
  return titled;
}

TitledTable contact_figures_table(const ContactGroup& group) {
  TitledTable titled{
      .title = group.engines.size() > 1 ? "All engines together" : "Other figures",
      .caption = fmt::format("{}{}.", contact_group_name(group),
                             group.engines.size() > 1 ? "; an episode counts once in each engine" : ""),
      .table = {.header = {"Region", "Touched", "Over limit [%]", "Ratio", "Median peak [N]", "After 0.1 s [N]",
                           "Quasi-static [N]", "Transient [N]", "Pressure [N/cm^2]", "Impulse [N s]"},
                .rows = {},
                .label_columns = 1}};
  for (const RegionContacts& contacts : group.all.regions) {
    const long episodes = group.all.episodes;
    titled.table.rows.push_back(
        {contacts.region, fmt::format("{} of {}", contacts.touched, episodes),
         percent(static_cast<double>(contacts.over) / static_cast<double>(episodes)), ratio_cell(contacts.ratio),
         force_number(contacts.median_peak), force_number(contacts.settled), force_number(contacts.quasi_static),
         force_number(contacts.transient), force_number(contacts.pressure_n_cm2), force_number(contacts.impulse)});
  }
  return titled;
}

struct ContactFigure {
  const char* name;
  const char* unit;
  double RegionContacts::*value;
};
constexpr ContactFigure kContactFigures[] = {{"peak", "N", &RegionContacts::peak},
                                             {"median_peak", "N", &RegionContacts::median_peak},
                                             {"quasi_static", "N", &RegionContacts::quasi_static},
                                             {"transient", "N", &RegionContacts::transient},
                                             {"settled", "N", &RegionContacts::settled},
                                             {"impulse", "N s", &RegionContacts::impulse},
                                             {"pressure", "N/cm^2", &RegionContacts::pressure_n_cm2},
                                             {"ratio", "1", &RegionContacts::ratio}};

void add_contact_figures(const ContactGroup& group, const EngineContacts& engine, std::vector<Figure>& into) {
  FiguresOf figures{{.engine = engine.engine, .controller = group.controller, .policy = group.policy}, into};
  for (const RegionContacts& contacts : engine.regions) {
    figures.keys.of = contacts.region;
    figures.count("touched", engine.episodes, contacts.touched);
    figures.count("over", engine.episodes, contacts.over);
    for (const ContactFigure& figure : kContactFigures)
      figures.add(figure.name, contacts.touched, contacts.*figure.value, kNoInterval, figure.unit);
  }
}

void add_contact_group(const ContactGroup& group, Analysis& analysis) {
  for (TitledTable titled : {peak_table(group), contact_figures_table(group)}) {
    titled.group = contact_group_name(group);
    analysis.tables.push_back(std::move(titled));
  }
  for (const EngineContacts& engine : group.engines) add_contact_figures(group, engine, analysis.figures);
  add_contact_figures(group, group.all, analysis.figures);
  FiguresOf{{.controller = group.controller, .policy = group.policy}, analysis.figures}.count(
      "diverged", group.all.episodes, group.diverged);
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

Analysis contact_analysis(const ContactTable& table) {
  Analysis analysis{.name = "contacts", .title = "Contact with people"};
  if (table.groups.empty()) {
    analysis.notes = {"No episode has contact forces with a solid partner."};
    return analysis;
  }
  if (!table.limits_verified)
    analysis.warning = "Limits: unverified (nobody has yet checked the table against ISO/TS 15066)";
  if (table.limits_verified) analysis.notes.emplace_back("Limits: verified");
  analysis.notes.insert(
      analysis.notes.end(),
      {"The impulse adds up magnitudes of region forces, so opposite pushes do not cancel; pressure is an estimate "
       "from how deep bodies overlap, not a measurement.",
       "Forces, pressure and impulse are the largest of any episode, the median is over the episodes that touched "
       "the region. In brackets, and as ratio: the largest of force and pressure over their limits, with an "
       "asterisk where a limit is exceeded; without brackets no limit is stated. Over limit: share of all episodes, "
       "touched or not. \"any\" is the whole body; regions that no episode touched are left out."});
  FiguresOf{{}, analysis.figures}.count("limits_verified", {}, table.limits_verified ? 1 : 0);
  for (const ContactGroup& group : table.groups) add_contact_group(group, analysis);
  return analysis;
}

}  // namespace duet
