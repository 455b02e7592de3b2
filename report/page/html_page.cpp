#include "duet/report/page/html_page.h"

#include <fmt/format.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/report/tables/line_plot.h"

namespace duet {
namespace {

// The file beside the program that was built, or where the shipped files are.
std::string viewer_file(const std::string& name) {
  std::error_code ignored;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  std::vector<std::string> places = {(program.parent_path() / "viewer" / name).string()};
  for (const std::string& share : share_folders()) places.push_back(fmt::format("{}/viewer/{}", share, name));
  try {
    return first_existing("viewer/" + name, places);
  } catch (const MissingError& error) {
    throw MissingError(fmt::format("{}; a build makes it where esbuild is installed", error.what()));
  }
}

// A script element's text ends at this, wherever it stands.
void require_embeddable(std::string_view text, std::string_view end, const char* what) {
  require(text.find(end) == std::string_view::npos, "{}: expected no '{}' in it", what, end);
}

}  // namespace

ViewerBundle load_viewer(const std::string& page) {
  return {read_text(viewer_file(page + ".js")), read_text(viewer_file(page + ".css"))};
}

ViewerBundle viewer_or_plain(const std::string& page, std::vector<std::string>& notes) {
  try {
    return load_viewer(page);
  } catch (const MissingError& error) {
    notes.push_back(fmt::format("The page has plain tables and no plots: {}.", error.what()));
    return {};
  }
}

std::string html_page(std::string_view title, std::string_view body, const PageData& data, const ViewerBundle& viewer) {
  require_embeddable(viewer.script, "</script", "the viewer's script");
  require_embeddable(viewer.style, "</style", "the viewer's style sheet");
  require_embeddable(data.text, "</script", "the data of the page");
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
      "<meta name=\"color-scheme\" content=\"light dark\"><meta name=\"generator\" content=\"duet\">"
      "<title>{}</title>\n<style>{}</style></head>\n<body>\n{}"
      "<script type=\"{}\" id=\"{}\">{}</script>\n<script>{}</script>\n</body></html>\n",
      escape_html(title), viewer.style, body, data.type, data.id, data.text, viewer.script);
}

namespace {

std::string cell_html(const std::string& cell, bool label) {
  const std::size_t bracket = cell.find(" [");
  const bool interval = bracket != std::string::npos && cell.ends_with(']') && !label;
  if (label) return fmt::format(R"(<th scope="row">{}</th>)", escape_html(cell));
  if (!interval) {
    const bool stands_out = cell.ends_with('*') || cell.ends_with("*)") || cell == "FAIL";
    const char* mark = stands_out ? R"( class="over")" : cell == "-" ? R"( class="zero")" : "";
    return fmt::format("<td{}>{}</td>", mark, escape_html(cell));
  }
  return fmt::format(R"(<td><span class="rate">{}</span> <span class="ci">{}</span></td>)",
                     escape_html(cell.substr(0, bracket)), escape_html(cell.substr(bracket + 1)));
}

std::string table_html(const TitledTable& titled) {
  const TextTable& table = titled.table;
  std::string html = R"(<div class="scroll" tabindex="0"><table>)";
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

// Tables of one group fold together where there are several groups; the first is unfolded.
std::string grouped_html(const std::vector<TitledTable>& tables) {
  const bool folds = !tables.empty() && tables.front().group != tables.back().group;
  std::string html;
  for (std::size_t i = 0; i < tables.size(); ++i) {
    const std::string& group = tables[i].group;
    const bool first = i == 0 || tables[i - 1].group != group,
               last = i + 1 == tables.size() || tables[i + 1].group != group;
    if (folds && first && !group.empty())
      html += fmt::format("<details{}><summary>{}</summary>", i == 0 ? " open" : "", escape_html(group));
    html += titled_table_html(tables[i]);
    if (folds && last && !group.empty()) html += "</details>\n";
  }
  return html;
}

std::string plot_groups_html(const std::vector<PlotGroup>& groups, bool titled, nlohmann::json& drawn) {
  std::string html;
  for (const PlotGroup& group : groups) {
    if (group.plots.empty() || group.title.empty() == titled) continue;
    if (titled) html += fmt::format("<h3>{}</h3>", escape_html(group.title));
    if (!group.note.empty()) html += fmt::format("<p>{}</p>", escape_html(group.note));
    html += plots_html(group.plots, drawn);
  }
  return html;
}

}  // namespace

std::string titled_table_html(const TitledTable& titled) {
  std::string html = titled.title.empty() ? "" : fmt::format("<h3>{}</h3>", escape_html(titled.title));
  if (!titled.table.rows.empty()) html += table_html(titled);
  if (titled.table.rows.empty() && !titled.caption.empty()) {
    html += fmt::format("<p>{}</p>", escape_html(titled.caption));
  }
  for (const std::string& note : titled.notes) html += fmt::format("<p>{}</p>", escape_html(note));
  return html + "\n";
}

std::string plots_html(const std::vector<LinePlot>& plots, nlohmann::json& drawn) {
  std::string html;
  for (const LinePlot& plot : plots) {
    nlohmann::json json = plot_json(plot);
    if (json.is_null()) continue;
    html += fmt::format("<figure data-plot=\"{}\"><figcaption>{}</figcaption></figure>", drawn.size(),
                        escape_html(plot.title));
    drawn.push_back(std::move(json));
  }
  return html.empty() ? "" : fmt::format("<div class=\"plots\">{}</div>\n", html);
}

std::string analysis_html(const Analysis& analysis, nlohmann::json& drawn) {
  std::string html;
  if (!analysis.warning.empty()) html += fmt::format("<p class=\"warning\">{}</p>\n", escape_html(analysis.warning));
  for (const std::string& note : analysis.notes) html += fmt::format("<p>{}</p>\n", escape_html(note));
  html += plot_groups_html(analysis.plots, false, drawn) + analysis.drawing + grouped_html(analysis.tables);
  return html + plot_groups_html(analysis.plots, true, drawn);
}

}  // namespace duet
