// Tables and analyses as HTML: one form for all tables, of real cells that any browser, reader or spreadsheet takes. A
// plot is a figure with its caption, which viewer/ fills from the data of the page.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/report/tables/analysis.h"

namespace duet {

// Caption, table and notes under a heading of level 3. A number with its interval is two spans; a cell that ends with
// an asterisk (over a limit) and one that says FAIL stand out.
std::string titled_table_html(const TitledTable& titled);

// Figures side by side, each under its title; `drawn` takes what the viewer draws (plot_json), a figure's number is its
// place there. Plots without a point are left out.
std::string plots_html(const std::vector<LinePlot>& plots, nlohmann::json& drawn);

// Notes, plots, tables with headings of level 3.
std::string analysis_html(const Analysis& analysis, nlohmann::json& drawn);

}  // namespace duet
