// The findings of one analysis of a run: estimates, and tables that are pivots of them. It is written here in every
// form that a report has (Markdown for files and terminals, LaTeX, CSV, JSON; HTML in report/page/html_page.h), so
// that a new one is a function that returns an Analysis and an entry in a list (report/page/run_analyses.cpp).
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "duet/report/tables/estimate.h"
#include "duet/report/tables/line_plot.h"

namespace duet {

// Plots side by side: without a title before the tables, with one below them.
struct PlotGroup {
  std::string title = {}, note = {};
  std::vector<LinePlot> plots = {};
};

struct Analysis {
  std::string name;     // of its files, its member in JSON and its section in HTML: "policies"
  std::string title;    // of that section
  double level = 0.95;  // of intervals
  // Before the tables, which then stand one heading below the title. Without tables: why there are none.
  std::string warning = {};  // what nobody may overlook; it stands out in HTML
  std::vector<std::string> notes = {};
  std::vector<TitledTable> tables = {};
  std::vector<PlotGroup> plots = {};
  std::string drawing = {};  // HTML in front of the tables
  Estimates estimates = {};
  bool opens = false;       // its section in HTML is among the first, and unfolded
  bool in_terminal = true;  // false: left to the files

  [[nodiscard]] bool empty() const { return estimates.empty(); }
};

std::string analysis_markdown(const Analysis& analysis);
// The text for a terminal, without the tables that are too long for it.
std::string terminal_text(const Analysis& analysis);
std::string analysis_latex(const Analysis& analysis);  // a table environment per table, the rest as comments
std::string analysis_csv(const Analysis& analysis);
// duet.analysis/1: `analysis`, `title`, `level`, `notes` (each that stands with a table), `figures`.
nlohmann::json analysis_json(const Analysis& analysis);

// Names and contents of the files of a format ("md", "csv", "json", "tex"; none for another): "policies.md", ...
std::vector<std::pair<std::string, std::string>> analysis_files(const std::vector<Analysis>& analyses,
                                                                const std::string& format);

// Each under its name, added to `json`.
void add_analyses(const std::vector<Analysis>& analyses, nlohmann::json& json);

// How a metric is named in tables; the catalogue of metrics is the caller's.
struct MetricColumn {
  std::string name, title, unit, direction;  // direction: "lower", "higher", ""
};

}  // namespace duet
