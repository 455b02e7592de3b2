#include "duet/report/tables/line_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/report/tables/axis.h"
#include "duet/report/tables/escape_html.h"

namespace duet {
namespace {

constexpr double kLeft = 62.0, kRight = 584.0, kLineTop = 26.0, kBottom = 190.0;
constexpr int kWidth = 600, kHeight = 232, kKeyWidth = 140, kKeyLine = 17, kColours = 9;

struct Frame {
  PlotAxis x{.from = kLeft, .to = kRight}, y{.from = kBottom, .to = kLineTop};
};

bool is_point(const LineSeries& series, std::size_t i) {
  return std::isfinite(series.x[i]) && std::isfinite(series.y[i]);
}

std::string grid(const Frame& frame, const LinePlot& plot) {
  return grid_lines(frame.y, kLeft, kRight) +
         fmt::format(R"(<line class="axis" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.0f}" y2="{2:.0f}"/>)", kLeft, kRight,
                     kBottom) +
         axis_ticks(frame.x, kBottom, plot.x_label) +
         fmt::format(R"(<text x="{:.0f}" y="14">{}</text>)", kLeft, escape_html(plot.y_label));
}

std::string path_of(const LineSeries& series, const Frame& frame) {
  const std::size_t count = series.x.size(), drawn = std::min(count, kPlotPoints);
  std::string path;
  bool pen_down = false;
  for (std::size_t i = 0; i < drawn; ++i) {
    const std::size_t at = drawn < 2 ? i : i * (count - 1) / (drawn - 1);
    if (!is_point(series, at)) {
      pen_down = false;
      continue;
    }
    path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", frame.x.at(series.x[at]), frame.y.at(series.y[at]));
    if (!pen_down) path += fmt::format("L{:.1f} {:.1f}", frame.x.at(series.x[at]), frame.y.at(series.y[at]));
    pen_down = true;
  }
  return path;
}

std::string series_svg(const LineSeries& series, std::size_t number, const Frame& frame) {
  return fmt::format(R"(<path style="stroke:var(--t{});stroke-linecap:round" d="{}"/>)", number % kColours,
                     path_of(series, frame));
}

// Below the plot, three series a line; nothing for one series, which the axis names.
std::string legend(const LinePlot& plot) {
  if (plot.series.size() < 2) return "";
  std::string svg;
  const int per_line = 3;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const int line = static_cast<int>(i) / per_line, place = static_cast<int>(i) % per_line;
    const int x = kWidth - per_line * kKeyWidth + place * kKeyWidth, y = kHeight + 4 + line * kKeyLine;
    svg += fmt::format(R"svg(<path style="stroke:var(--t{})" d="M{} {}h18"/>)svg", i % kColours, x, y - 4);
    svg += fmt::format(R"(<text class="key" x="{}" y="{}">{}</text>)", x + 24, y, escape_html(plot.series[i].name));
  }
  return svg;
}

int height_of(const LinePlot& plot) {
  const auto lines = static_cast<int>((plot.series.size() + 2) / 3);
  return plot.series.size() < 2 ? kHeight : kHeight + 4 + kKeyLine * lines - 6;
}

}  // namespace

std::string line_plot_svg(const LinePlot& plot) {
  Frame frame;
  for (const LineSeries& series : plot.series) {
    require(series.x.size() == series.y.size(), "line plot '{}': series '{}' has {} x but {} y", plot.title,
            series.name, series.x.size(), series.y.size());
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!is_point(series, i)) continue;
      frame.x.take(series.x[i]);
      frame.y.take(series.y[i]);
    }
  }
  if (frame.x.empty()) return "";
  frame.x.round(6);
  frame.y.round(5);
  std::string svg = fmt::format(R"(<svg class="plot" viewBox="0 0 {} {}" role="img" aria-label="{}">)", kWidth,
                                height_of(plot), escape_html(plot.title));
  svg += grid(frame, plot);
  for (std::size_t i = 0; i < plot.series.size(); ++i) svg += series_svg(plot.series[i], i, frame);
  return svg + legend(plot) + "</svg>";
}

}  // namespace duet
