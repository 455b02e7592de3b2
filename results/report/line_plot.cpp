#include "duet/results/report/line_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/require.h"
#include "duet/results/report/escape_html.h"

namespace duet {
namespace {

constexpr double kLeft = 62.0, kRight = 584.0, kLineTop = 26.0, kBottom = 190.0;
constexpr int kWidth = 600, kHeight = 232, kKeyWidth = 140, kKeyLine = 17, kColours = 9;

struct Axis {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void take(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // Room for a line that is level, and to the next round value on either side.
  void round(int intervals) {
    if (high - low <= 1e-12 * std::max(std::abs(high), std::abs(low))) {
      const double room = high == 0.0 ? 1.0 : 0.1 * std::abs(high);
      low -= room;
      high += room;
    }
    step = nice_step(high - low, intervals);
    low = std::floor(low / step + 1e-9) * step;
    high = std::ceil(high / step - 1e-9) * step;
  }
  double step = 1.0;
};

struct Frame {
  Axis x, y;
  [[nodiscard]] double at_x(double value) const {
    return kLeft + (kRight - kLeft) * (value - x.low) / (x.high - x.low);
  }
  [[nodiscard]] double at_y(double value) const {
    return kBottom - (kBottom - kLineTop) * (value - y.low) / (y.high - y.low);
  }
};

bool is_point(const LineSeries& series, std::size_t i) {
  return std::isfinite(series.x[i]) && std::isfinite(series.y[i]);
}

// 12000 -> "12k", 3e6 -> "3M".
std::string tick_label(double value, double step) {
  if (std::abs(value) < 1e-9 * step) return "0";
  const double size = std::abs(value);
  if (size >= 1e6) return fmt::format("{:g}M", value / 1e6);
  if (size >= 1e4) return fmt::format("{:g}k", value / 1e3);
  return fmt::format("{:.{}f}", value, std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9))));
}

template <typename Draw>
void for_each_tick(const Axis& axis, const Draw& draw) {
  const auto count = static_cast<int>(std::lround((axis.high - axis.low) / axis.step));
  for (int i = 0; i <= count; ++i) draw(axis.low + i * axis.step);
}

std::string grid(const Frame& frame, const LinePlot& plot) {
  std::string svg;
  for_each_tick(frame.y, [&](double value) {
    const double y = frame.at_y(value);
    svg += fmt::format(R"(<line class="grid" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.1f}" y2="{2:.1f}"/>)", kLeft, kRight, y);
    svg += fmt::format(R"(<text x="{:.0f}" y="{:.1f}" text-anchor="end">{}</text>)", kLeft - 7.0, y + 4.0,
                       tick_label(value, frame.y.step));
  });
  svg += fmt::format(R"(<line class="axis" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.0f}" y2="{2:.0f}"/>)", kLeft, kRight,
                     kBottom);
  for_each_tick(frame.x, [&](double value) {
    svg += fmt::format(R"(<text x="{:.1f}" y="{:.0f}" text-anchor="middle">{}</text>)", frame.at_x(value),
                       kBottom + 17.0, tick_label(value, frame.x.step));
  });
  svg += fmt::format(R"(<text x="{:.0f}" y="{:.0f}" text-anchor="middle">{}</text>)", (kLeft + kRight) / 2.0,
                     kBottom + 35.0, escape_html(plot.x_label));
  return svg + fmt::format(R"(<text x="{:.0f}" y="14">{}</text>)", kLeft, escape_html(plot.y_label));
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
    path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", frame.at_x(series.x[at]), frame.at_y(series.y[at]));
    if (!pen_down) path += fmt::format("L{:.1f} {:.1f}", frame.at_x(series.x[at]), frame.at_y(series.y[at]));
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

double nice_step(double span, int intervals) {
  const double raw = span / intervals;
  const double decade = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= raw * (1.0 - 1e-9)) return factor * decade;
  }
  return 10.0 * decade;
}

std::string line_plot_svg(const LinePlot& plot) {
  Frame frame;
  for (const LineSeries& series : plot.series) {
    require(series.x.size() == series.y.size(), fmt::format("line plot '{}': series '{}' has {} x but {} y", plot.title,
                                                            series.name, series.x.size(), series.y.size()));
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!is_point(series, i)) continue;
      frame.x.take(series.x[i]);
      frame.y.take(series.y[i]);
    }
  }
  if (!(frame.x.low <= frame.x.high)) return "";
  frame.x.round(6);
  frame.y.round(5);
  std::string svg = fmt::format(R"(<svg class="plot" viewBox="0 0 {} {}" role="img" aria-label="{}">)", kWidth,
                                height_of(plot), escape_html(plot.title));
  svg += grid(frame, plot);
  for (std::size_t i = 0; i < plot.series.size(); ++i) svg += series_svg(plot.series[i], i, frame);
  return svg + legend(plot) + "</svg>";
}

}  // namespace duet
