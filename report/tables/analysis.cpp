#include "duet/report/tables/analysis.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/rows/json_fields.h"

namespace duet {
namespace {

std::vector<std::string> lead_of(const Analysis& analysis) {
  std::vector<std::string> lead = analysis.notes;
  if (!analysis.warning.empty()) lead.insert(lead.begin(), analysis.warning);
  return lead;
}

// The notes alone where there are no tables; with both a heading over them.
std::string markdown_text(const Analysis& analysis, bool in_terminal) {
  std::vector<std::string> parts;
  const std::vector<std::string> lead = lead_of(analysis);
  if (!lead.empty() && !analysis.tables.empty()) parts.push_back("### " + escape_markdown(analysis.title) + "\n");
  for (const std::string& note : lead) parts.push_back(escape_markdown(note) + "\n");
  for (const TitledTable& titled : analysis.tables)
    if (!in_terminal || !titled.too_long_for_terminal)
      parts.push_back((lead.empty() || titled.title.empty() ? "" : "#") + markdown_of(titled));
  std::string text;
  for (const std::string& part : parts) text.append(text.empty() ? "" : "\n").append(part);
  return text;
}

std::string text_of(const Analysis& analysis, const std::string& format) {
  if (format == "md") return analysis_markdown(analysis);
  if (format == "csv") return analysis_csv(analysis);
  if (format == "tex") return analysis_latex(analysis);
  if (format == "json") return dumped(analysis_json(analysis), 2) + "\n";
  return "";
}

}  // namespace

std::string analysis_markdown(const Analysis& analysis) { return markdown_text(analysis, false); }

std::string terminal_text(const Analysis& analysis) { return markdown_text(analysis, true); }

std::string analysis_latex(const Analysis& analysis) {
  std::string text = analysis.tables.empty() ? "" : "% \\usepackage{booktabs, graphicx}\n";
  for (const std::string& note : lead_of(analysis)) text += latex_comment(note);
  for (const TitledTable& titled : analysis.tables) text.append("\n").append(latex_of(titled));
  return text;
}

std::string analysis_csv(const Analysis& analysis) {
  return estimates_csv(analysis.name, analysis.level, analysis.estimates);
}

nlohmann::json analysis_json(const Analysis& analysis) {
  std::vector<std::string> notes = lead_of(analysis);
  for (const TitledTable& titled : analysis.tables)
    for (const std::string& note : titled.notes)
      if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
  return {{"schema", "duet.analysis/1"}, {"analysis", analysis.name}, {"title", analysis.title},
          {"level", analysis.level},     {"notes", std::move(notes)}, {"figures", estimates_json(analysis.estimates)}};
}

std::vector<std::pair<std::string, std::string>> analysis_files(const std::vector<Analysis>& analyses,
                                                                const std::string& format) {
  std::vector<std::pair<std::string, std::string>> files;
  for (const Analysis& analysis : analyses)
    if (std::string text = text_of(analysis, format); !text.empty())
      files.emplace_back(analysis.name + "." + format, std::move(text));
  return files;
}

void add_analyses(const std::vector<Analysis>& analyses, nlohmann::json& json) {
  for (const Analysis& analysis : analyses) json[analysis.name] = analysis_json(analysis);
}

}  // namespace duet
