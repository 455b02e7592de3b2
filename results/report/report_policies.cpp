// The sections "Policies", "Perturbations", "Reactivity", "Recorded and synthetic people" and "Levels" of the HTML
// report.
#include "duet/results/report/report_parts.h"

namespace duet {
namespace {

std::string section_html(const std::vector<LinePlot>& plots, const std::vector<TitledTable>& tables) {
  std::string html = plots.empty() ? "" : plots_html(plots);
  for (const TitledTable& titled : tables) html += titled_table_html(titled);
  return html;
}

}  // namespace

std::string policies_html(const PolicyTable& table) { return section_html({}, policy_tables(table)); }

std::string degradation_html(const Degradation& result) {
  return section_html(degradation_plots(result), degradation_tables(result));
}

std::string people_html(const PeopleTable& table) { return section_html({}, people_tables(table)); }

std::string levels_html(const std::vector<LevelTable>& tables) { return section_html({}, titled_levels(tables)); }

std::string reactivity_html(const ReactivityTable& table) {
  return section_html(reactivity_plots(table), reactivity_tables(table));
}

}  // namespace duet
