// The loss curves of one clip as an inline SVG.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/report/page/report_parts.h"
#include "duet/report/tables/axis.h"
#include "duet/report/tables/cells.h"
#include "duet/report/tables/escape_html.h"

namespace duet {
namespace {

constexpr double kLossLeft = 52.0, kLossRight = 420.0, kLossTop = 22.0, kLossBottom = 206.0;
constexpr int kLossWidth = 600, kLossHeight = 246, kLossKeyLine = 17;
constexpr std::size_t kMaximumPoints = 120;
constexpr double kLogarithmicSpan = 20.0;

struct Curve {
  std::string name;
  const std::vector<double>* values;
  double last = std::numeric_limits<double>::quiet_NaN();
};

bool is_total(const std::string& name) { return name == "total" || name == "loss"; }

// The total first, then the largest at the end first: as they lie over one another at the right of the plot.
std::vector<Curve> curves_of(const std::map<std::string, std::vector<double>>& loss) {
  std::vector<Curve> curves;
  for (const auto& [name, values] : loss) {
    Curve curve{.name = name, .values = &values};
    for (const double value : values) {
      if (std::isfinite(value)) curve.last = value;
    }
    if (std::isfinite(curve.last)) curves.push_back(std::move(curve));
  }
  std::stable_sort(curves.begin(), curves.end(), [](const Curve& a, const Curve& b) {
    return is_total(a.name) != is_total(b.name) ? is_total(a.name) : a.last > b.last;
  });
  return curves;
}

PlotAxis axis_of(const std::vector<Curve>& curves) {
  PlotAxis axis{.from = kLossBottom, .to = kLossTop};
  double positive = axis.low;
  for (const Curve& curve : curves) {
    for (const double value : *curve.values) {
      if (!std::isfinite(value)) continue;
      axis.take(value);
      if (value > 0.0) positive = std::min(positive, value);
    }
  }
  // Terms that fall to nothing must not stretch the axis over dozens of decades.
  positive = std::max(positive, axis.high * 1e-6);
  if (axis.low >= 0.0 && axis.high > kLogarithmicSpan * positive) {
    PlotAxis decades{.from = kLossBottom, .to = kLossTop, .logarithmic = true};
    decades.take(positive);
    decades.take(axis.high);
    decades.round_decades(6);
    return decades;
  }
  axis.take(0.0);
  if (axis.high <= axis.low) axis.high = axis.low + 1.0;
  axis.step = nice_step(axis.high - axis.low, 5);
  return axis;
}

PlotAxis iterations(std::size_t last) {
  PlotAxis axis{.from = kLossLeft, .to = kLossRight, .low = 0.0, .high = std::max(1.0, static_cast<double>(last))};
  axis.step = std::max(1.0, nice_step(axis.high, 5));
  return axis;
}

// A path that is interrupted where a value cannot be shown on this axis.
std::string path_of(const std::vector<double>& values, const PlotAxis& axis, const PlotAxis& x) {
  const std::size_t count = std::min(values.size(), kMaximumPoints);
  std::string path;
  bool pen_down = false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = count == 1 ? 0 : i * (values.size() - 1) / (count - 1);
    const double value = values[at];
    if (!std::isfinite(value) || (axis.logarithmic && value <= 0.0)) {
      pen_down = false;
      continue;
    }
    path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", x.at(static_cast<double>(at)),
                        std::min(axis.at(value), kLossBottom));
    pen_down = true;
  }
  return path;
}

std::string curve_svg(const Curve& curve, std::size_t place, const PlotAxis& axis, const PlotAxis& x) {
  const std::string colour = is_total(curve.name) ? "var(--t0)" : fmt::format("var(--t{})", 1 + place % 8);
  const char* dash = place >= 16 ? R"( stroke-dasharray="1.5 3")" : place >= 8 ? R"( stroke-dasharray="6 3")" : "";
  const int y = 28 + kLossKeyLine * static_cast<int>(place);
  std::string svg = fmt::format(
      R"(<path d="{}" style="stroke:{}{}"{}><title>{}: {} at the end</title></path>)", path_of(*curve.values, axis, x),
      colour, is_total(curve.name) ? ";stroke-width:2.6" : "", dash, escape_html(curve.name), significant(curve.last));
  svg += fmt::format(R"(<path d="M434 {}h18" style="stroke:{};stroke-width:2.6"{}/>)", y - 4, colour, dash);
  return svg +
         fmt::format(R"(<text class="key" x="458" y="{}">{}</text><text x="{}" y="{}" text-anchor="end">{}</text>)", y,
                     escape_html(curve.name), kLossWidth - 4, y, fmt::format("{:.3g}", curve.last));
}

}  // namespace

std::string loss_plot_svg(const std::map<std::string, std::vector<double>>& loss) {
  const std::vector<Curve> curves = curves_of(loss);
  if (curves.empty()) return "";
  std::size_t last = 0;
  for (const Curve& curve : curves) last = std::max(last, curve.values->size() - 1);
  const PlotAxis axis = axis_of(curves), x = iterations(last);
  const int height = std::max(kLossHeight, 24 + kLossKeyLine * static_cast<int>(curves.size() + 1));
  std::string svg =
      fmt::format(R"(<svg class="plot" viewBox="0 0 {} {}" role="img" aria-label="Loss terms over {} iterations">)",
                  kLossWidth, height, last);
  svg += fmt::format(R"(<text x="{:.0f}" y="11">loss{}</text>)", kLossLeft, axis.logarithmic ? " (logarithmic)" : "");
  svg += fmt::format(R"(<text x="{}" y="11" text-anchor="end">at the end</text>)", kLossWidth - 4);
  svg += grid_lines(axis, kLossLeft, kLossRight);
  svg += fmt::format(R"(<line class="axis" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.0f}" y2="{2:.0f}"/>)", kLossLeft,
                     kLossRight, kLossBottom);
  svg += axis_ticks(x, kLossBottom, "iteration");
  // The total is drawn last, over the others.
  for (std::size_t i = curves.size(); i-- > 0;) svg += curve_svg(curves[i], i, axis, x);
  return svg + "</svg>";
}

}  // namespace duet
