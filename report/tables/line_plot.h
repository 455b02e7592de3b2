// A small line plot, declared: several series, two axes with their units. viewer/src/plot.ts draws it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct LineSeries {
  std::string name;
  std::vector<double> x, y;  // as long as one another; points that are not finite interrupt the line
};

struct LinePlot {
  std::string title;
  std::string x_label, y_label;  // with the unit, "time [s]"
  std::vector<LineSeries> series;
  bool loss = false;  // terms that fall: a logarithmic axis where they span much, and the values at the end
};

// `title`, `x_label`, `y_label`, `loss`, `series` of {name, x, y}; x is left out where it is that of the series before.
// Null where no series has a finite point. At most kPlotPoints points of a series, the first and last among them, with
// kPlotDigits digits; null for one that is not finite. Throws std::invalid_argument for a series whose x and y differ
// in length.
inline constexpr std::size_t kPlotPoints = 400;
inline constexpr int kPlotDigits = 5;
nlohmann::json plot_json(const LinePlot& plot);

// Text within HTML.
std::string escape_html(std::string_view text);  // also for attribute values in double quotes

}  // namespace duet
