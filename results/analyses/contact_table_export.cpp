// Contact tables as text and for other programs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/results/analyses/contact_table_parts.h"
#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

// Three significant digits as far as they are decimals; "-" for NaN.
std::string short_number(double value) {
  if (!std::isfinite(value)) return "-";
  if (value >= 1e5) return fmt::format("{:.3g}", value);
  return fmt::format("{:.{}f}", value, value >= 100.0 ? 0 : value >= 10.0 ? 1 : 2);
}

std::string ratio_cell(double ratio) { return fmt::format("{}{}", short_number(ratio), ratio > 1.0 ? "*" : ""); }

std::string peak_cell(const RegionContacts& contacts) {
  if (!std::isfinite(contacts.ratio)) return short_number(contacts.peak);
  return fmt::format("{} ({})", short_number(contacts.peak), ratio_cell(contacts.ratio));
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
                     .table = {.header = {"Region"}, .rows = {}, .label_columns = 1},
                     .notes = {}};
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

TitledTable figures_table(const ContactGroup& group) {
  TitledTable titled{.title = group.engines.size() > 1 ? "All engines together" : "Other figures",
                     .caption = fmt::format("{}{}.", contact_group_name(group),
                                            group.engines.size() > 1 ? "; an episode counts once in each engine" : ""),
                     .table = {.header = {"Region", "Touched", "Over limit [%]", "Ratio", "Median peak [N]",
                                          "Quasi-static [N]", "Transient [N]", "Pressure [N/cm^2]", "Impulse [N s]"},
                               .rows = {},
                               .label_columns = 1},
                     .notes = {}};
  for (const RegionContacts& contacts : group.all.regions) {
    const long episodes = group.all.episodes;
    titled.table.rows.push_back({contacts.region, fmt::format("{} of {}", contacts.touched, episodes),
                                 percent(static_cast<double>(contacts.over) / static_cast<double>(episodes)),
                                 ratio_cell(contacts.ratio), short_number(contacts.median_peak),
                                 short_number(contacts.quasi_static), short_number(contacts.transient),
                                 short_number(contacts.pressure_n_cm2), short_number(contacts.impulse)});
  }
  return titled;
}

struct NamedFigure {
  const char* name;
  const char* unit;
  double RegionContacts::*value;
};
constexpr NamedFigure kFigures[] = {{"peak", "N", &RegionContacts::peak},
                                    {"median_peak", "N", &RegionContacts::median_peak},
                                    {"quasi_static", "N", &RegionContacts::quasi_static},
                                    {"transient", "N", &RegionContacts::transient},
                                    {"impulse", "N s", &RegionContacts::impulse},
                                    {"pressure", "N/cm^2", &RegionContacts::pressure_n_cm2},
                                    {"ratio", "1", &RegionContacts::ratio}};

void add_figures(const ContactGroup& group, const EngineContacts& engine, const std::string& limits, TextTable& table) {
  for (const RegionContacts& contacts : engine.regions) {
    const auto line = [&](const char* figure, const char* unit, long n, const std::string& value) {
      table.rows.push_back({group.controller, group.policy, engine.engine, contacts.region, limits, unit, figure,
                            fmt::format("{}", n), value});
    };
    line("touched", "1", engine.episodes, fmt::format("{}", contacts.touched));
    line("over", "1", engine.episodes, fmt::format("{}", contacts.over));
    for (const NamedFigure& figure : kFigures)
      line(figure.name, figure.unit, contacts.touched, number_cell(contacts.*figure.value));
  }
}

nlohmann::json json_of(const EngineContacts& engine) {
  nlohmann::json regions = nlohmann::json::array();
  for (const RegionContacts& contacts : engine.regions) {
    nlohmann::json region = {{"region", contacts.region}, {"touched", contacts.touched}, {"over", contacts.over}};
    for (const NamedFigure& figure : kFigures) region[figure.name] = number_or_null(contacts.*figure.value);
    regions.push_back(std::move(region));
  }
  return {{"engine", engine.engine}, {"episodes", engine.episodes}, {"regions", std::move(regions)}};
}

nlohmann::json json_of(const ContactGroup& group) {
  nlohmann::json engines = nlohmann::json::array();
  for (const EngineContacts& engine : group.engines) engines.push_back(json_of(engine));
  return {{"controller", group.controller},
          {"policy", group.policy},
          {"diverged", group.diverged},
          {"engines", std::move(engines)},
          {"all", json_of(group.all)}};
}

}  // namespace

std::string limits_mark(const ContactTable& table) {
  return table.limits_verified ? "Limits: verified"
                               : "Limits: unverified (nobody has yet checked the table against ISO/TS 15066)";
}

std::string contact_group_name(const ContactGroup& group) {
  return fmt::format("Controller {}, policy {}", group.controller, group.policy);
}

std::vector<TitledTable> contact_group_tables(const ContactGroup& group) {
  return {peak_table(group), figures_table(group)};
}

std::vector<std::string> contact_notes() {
  return {
      "The impulse adds up magnitudes of region forces, so opposite pushes do not cancel; pressure is an estimate "
      "from how deep bodies overlap, not a measurement.",
      "Forces, pressure and impulse are the largest of any episode, the median is over the episodes that touched "
      "the region. In brackets, and as ratio: the largest of force and pressure over their limits, with an "
      "asterisk where a limit is exceeded; without brackets no limit is stated. Over limit: share of all episodes, "
      "touched or not. \"any\" is the whole body; regions that no episode touched are left out."};
}

std::string no_contacts() { return "No episode has contact forces with a solid partner."; }

std::string contact_table_markdown(const ContactTable& table) {
  if (table.groups.empty()) return no_contacts() + "\n";
  std::string text = fmt::format("### {}\n\n{}\n", kContactTitle, limits_mark(table));
  for (const std::string& note : contact_notes()) text += fmt::format("\n{}\n", note);
  for (const ContactGroup& group : table.groups) {
    for (const TitledTable& titled : contact_group_tables(group)) text += fmt::format("\n#{}", markdown_of(titled));
  }
  return text;
}

std::string contact_table_csv(const ContactTable& table) {
  TextTable lines;
  lines.header = {"controller", "policy", "engine", "region", "limits", "unit", "figure", "n", "value"};
  const std::string limits = table.limits_verified ? "verified" : "unverified";
  for (const ContactGroup& group : table.groups) {
    for (const EngineContacts& engine : group.engines) add_figures(group, engine, limits, lines);
    add_figures(group, group.all, limits, lines);
  }
  return csv_table(lines);
}

std::string contact_table_latex(const ContactTable& table) {
  if (table.groups.empty()) return fmt::format("% {}\n", no_contacts());
  std::string text = fmt::format("% \\usepackage{{booktabs}}\n% {}\n", limits_mark(table));
  for (const std::string& note : contact_notes()) text += fmt::format("% {}\n", note);
  for (const ContactGroup& group : table.groups) {
    for (const TitledTable& titled : contact_group_tables(group)) text.append("\n").append(latex_of(titled));
  }
  return text;
}

nlohmann::json contact_table_json(const ContactTable& table) {
  nlohmann::json groups = nlohmann::json::array();
  for (const ContactGroup& group : table.groups) groups.push_back(json_of(group));
  return {{"schema", "duet.contact_table/1"},
          {"limits_verified", table.limits_verified},
          {"limits", limits_mark(table)},
          {"groups", std::move(groups)}};
}

}  // namespace duet
