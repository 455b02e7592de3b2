// A page that opens from disk without a network: one HTML file that holds its data, and the script and the style sheet
// of viewer/ that draw them.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/analysis.h"

namespace duet {

// Script and style sheet that a page is made with; without them it is plain HTML.
struct ViewerBundle {
  std::string script, style;
};

// Loads the bundle of this name ("replay", "rate", "report"): in viewer/ beside the program, or of the folders of
// core/share.h. Throws MissingError naming the file, the places looked at and what makes it.
ViewerBundle load_viewer(const std::string& page = "replay");
// An empty one where it is absent, with a note that says so.
ViewerBundle viewer_or_plain(const std::string& page, std::vector<std::string>& notes);

// The data of a page: text of a script element of this id and media type, which no browser runs.
struct PageData {
  std::string id, type, text;
};

// `title` is text, `body` HTML. Throws std::invalid_argument for a script, a style or data that would end its element.
std::string html_page(std::string_view title, std::string_view body, const PageData& data, const ViewerBundle& viewer);

// Tables and analyses as HTML: one form for all tables, of real cells that any browser, reader or spreadsheet takes. A
// plot is a figure with its caption, which viewer/ fills from the data of the page.

// Caption, table and notes under a heading of level 3. A number with its interval is two spans; a cell that ends with
// an asterisk (over a limit) and one that says FAIL stand out.
std::string titled_table_html(const TitledTable& titled);

// Figures side by side, each under its title; `drawn` takes what the viewer draws (plot_json), a figure's number is its
// place there. Plots without a point are left out.
std::string plots_html(const std::vector<LinePlot>& plots, nlohmann::json& drawn);

// Notes, plots, tables with headings of level 3.
std::string analysis_html(const Analysis& analysis, nlohmann::json& drawn);

}  // namespace duet
