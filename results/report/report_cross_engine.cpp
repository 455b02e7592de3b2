// The section "Across engines" of the HTML report.
#include <fmt/format.h>

#include "duet/results/analyses/cross_engine_tables.h"
#include "duet/results/report/escape_html.h"
#include "duet/results/report/report_parts.h"

namespace duet {
namespace {

std::string cell_html(const std::string& cell, bool label) {
  const std::size_t bracket = cell.find(" [");
  const bool interval = bracket != std::string::npos && cell.ends_with(']') && !label;
  if (label) return fmt::format(R"(<th scope="row" class="l">{}</th>)", escape_html(cell));
  if (!interval) {
    const bool over_limit = cell.ends_with('*') || cell.ends_with("*)");
    const char* mark = over_limit ? R"( class="over")" : cell == "-" ? R"( class="zero")" : "";
    return fmt::format("<td{}>{}</td>", mark, escape_html(cell));
  }
  return fmt::format(R"(<td><span class="rate">{}</span><span class="ci">{}</span></td>)",
                     escape_html(cell.substr(0, bracket)), escape_html(cell.substr(bracket + 1)));
}

std::string table_html(const TitledTable& titled) {
  const TextTable& table = titled.table;
  std::string html = R"(<div class="scroll" tabindex="0"><table class="compact">)";
  if (!titled.caption.empty()) html += fmt::format("<caption>{}</caption>", escape_html(titled.caption));
  html += "<thead><tr>";
  for (std::size_t i = 0; i < table.header.size(); ++i) {
    html += fmt::format(R"(<th scope="col"{}>{}</th>)", i < table.label_columns ? R"( class="l")" : "",
                        escape_html(table.header[i]));
  }
  html += "</tr></thead><tbody>\n";
  for (const std::vector<std::string>& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) html += cell_html(row[i], i < table.label_columns);
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>";
}

}  // namespace

std::string titled_table_html(const TitledTable& titled) {
  std::string html = fmt::format("<h3>{}</h3>", escape_html(titled.title));
  if (!titled.table.rows.empty()) html += table_html(titled);
  if (titled.table.rows.empty() && !titled.caption.empty()) {
    html += fmt::format("<p>{}</p>", escape_html(titled.caption));
  }
  for (const std::string& note : titled.notes) html += fmt::format("<p>{}</p>", escape_html(note));
  return html + "\n";
}

std::string cross_engine_html(const ReportContent& content) {
  if (!content.cross_engine.has_value()) return "";
  const CrossEngine& result = *content.cross_engine;
  const std::vector<TitledTable> tables = cross_engine_tables(result);
  std::string html = tables.empty() ? fmt::format("<p>{}</p>\n", escape_html(too_few_engines(result)))
                                    : engine_plot_html(result) +
                                          "<p>Dots: success in each engine with its interval; bar: the mean over "
                                          "engines, on the shade of its interval.</p>\n";
  for (const TitledTable& titled : tables) html += titled_table_html(titled);
  return html + titled_table_html(certificate_table(content.certificate, result.engines));
}

}  // namespace duet
