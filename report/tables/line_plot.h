// A small line plot as an inline SVG, styled by the report (light and dark): several series, two axes with their units,
// a legend.
#pragma once

#include <string>
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
};

// "" where no series has a finite point. At most kPlotPoints points of a series are drawn, the first and last among
// them. Throws std::invalid_argument for a series whose x and y differ in length.
inline constexpr std::size_t kPlotPoints = 400;
std::string line_plot_svg(const LinePlot& plot);

}  // namespace duet
