// One axis of a plot, of values or of their logarithms: its range, its ticks, the pixel of a value, the lines of its
// grid. Every plotter's scale.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace duet {

struct PlotAxis {
  double from, to;  // [px], of the lowest and the highest
  bool logarithmic = false;
  // The range of what is drawn: the value, or its decimal logarithm. Empty before the first value was taken.
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  double step = 1.0;  // between ticks, of the same

  void take(double value);
  [[nodiscard]] bool empty() const { return !(low <= high); }
  // Rounds to the next tick on either side, with at most so many intervals; with room where all values are one.
  void round(int intervals);
  // Whole decades, one or more; ticks of two where there are more than `most`.
  void round_decades(int most);
  [[nodiscard]] double at(double value) const;         // [px]
  [[nodiscard]] std::vector<double> ticks() const;     // values
  [[nodiscard]] std::string label(double tick) const;  // "0.25", "12k", "3M"; "0.01", "1e-5" where logarithmic
};

// A round step (1, 2 or 5 times a power of ten) that gives at most `intervals` in `span` > 0.
double nice_step(double span, int intervals);

// Lines of class "grid" from `left` to `right` with the ticks of `y` to their left.
std::string grid_lines(const PlotAxis& y, double left, double right);
// The ticks of `x` below the plot, whose lower edge is `bottom`, and its name below them.
std::string axis_ticks(const PlotAxis& x, double bottom, const std::string& name);

}  // namespace duet
