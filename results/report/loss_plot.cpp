// The loss curves of one clip as an inline SVG.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/report/escape_html.h"
#include "duet/results/report/line_plot.h"
#include "duet/results/report/report_parts.h"

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

struct LossAxis {
  double low, high;  // of the plotted quantity, which is the logarithm where `logarithmic`
  bool logarithmic;

  [[nodiscard]] double y(double value) const {
    const double plotted = logarithmic ? std::log10(value) : value;
    return kLossBottom - (kLossBottom - kLossTop) * (plotted - low) / (high - low);
  }
};

LossAxis axis_of(const std::vector<Curve>& curves) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  double positive = low;
  for (const Curve& curve : curves) {
    for (const double value : *curve.values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
      if (value > 0.0) positive = std::min(positive, value);
    }
  }
  // Terms that fall to nothing must not stretch the axis over dozens of decades.
  positive = std::max(positive, high * 1e-6);
  if (low >= 0.0 && high > kLogarithmicSpan * positive) {
    return {.low = std::floor(std::log10(positive)), .high = std::ceil(std::log10(high)), .logarithmic = true};
  }
  low = std::min(low, 0.0);
  return {.low = low, .high = high > low ? high : low + 1.0, .logarithmic = false};
}

std::string horizontal_line(double y, const std::string& label) {
  return fmt::format(R"(<line class="grid" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.1f}" y2="{2:.1f}"/>)", kLossLeft,
                     kLossRight, y) +
         fmt::format(R"(<text x="{:.0f}" y="{:.1f}" text-anchor="end">{}</text>)", kLossLeft - 7.0, y + 4.0, label);
}

std::string value_axis(const LossAxis& axis) {
  std::string svg;
  if (axis.logarithmic) {
    const int step = std::max(1, static_cast<int>(std::ceil((axis.high - axis.low) / 6.0)));
    for (int decade = static_cast<int>(axis.low); decade <= static_cast<int>(axis.high); decade += step) {
      svg += horizontal_line(axis.y(std::pow(10.0, decade)), std::abs(decade) <= 3
                                                                 ? fmt::format("{:g}", std::pow(10.0, decade))
                                                                 : fmt::format("1e{}", decade));
    }
    return svg;
  }
  const double step = nice_step(axis.high - axis.low, 5);
  for (double tick = std::ceil(axis.low / step - 1e-9) * step; tick <= axis.high + 1e-9 * step; tick += step) {
    svg += horizontal_line(axis.y(tick), significant(std::abs(tick) < 1e-9 * step ? 0.0 : tick));
  }
  return svg;
}

double x_of(std::size_t iteration, std::size_t last) {
  return kLossLeft + (kLossRight - kLossLeft) * static_cast<double>(iteration) /
                         static_cast<double>(std::max<std::size_t>(last, 1));
}

std::string iteration_axis(std::size_t last) {
  std::string svg = fmt::format(R"(<line class="axis" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.0f}" y2="{2:.0f}"/>)",
                                kLossLeft, kLossRight, kLossBottom);
  const double step = std::max(1.0, nice_step(static_cast<double>(std::max<std::size_t>(last, 1)), 5));
  for (double tick = 0.0; tick <= static_cast<double>(last) + 0.5; tick += step) {
    svg += fmt::format(R"(<text x="{:.1f}" y="{:.0f}" text-anchor="middle">{:.0f}</text>)",
                       x_of(static_cast<std::size_t>(tick), last), kLossBottom + 17.0, tick);
  }
  return svg + fmt::format(R"(<text x="{:.0f}" y="{:.0f}" text-anchor="middle">iteration</text>)",
                           (kLossLeft + kLossRight) / 2.0, kLossBottom + 35.0);
}

// A path that is interrupted where a value cannot be shown on this axis.
std::string path_of(const std::vector<double>& values, const LossAxis& axis, std::size_t last) {
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
    path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", x_of(at, last), std::min(axis.y(value), kLossBottom));
    pen_down = true;
  }
  return path;
}

std::string curve_svg(const Curve& curve, std::size_t place, const LossAxis& axis, std::size_t last) {
  const std::string colour = is_total(curve.name) ? "var(--t0)" : fmt::format("var(--t{})", 1 + place % 8);
  const char* dash = place >= 16 ? R"( stroke-dasharray="1.5 3")" : place >= 8 ? R"( stroke-dasharray="6 3")" : "";
  const int y = 28 + kLossKeyLine * static_cast<int>(place);
  std::string svg =
      fmt::format(R"(<path d="{}" style="stroke:{}{}"{}><title>{}: {} at the end</title></path>)",
                  path_of(*curve.values, axis, last), colour, is_total(curve.name) ? ";stroke-width:2.6" : "", dash,
                  escape_html(curve.name), significant(curve.last));
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
  const LossAxis axis = axis_of(curves);
  const int height = std::max(kLossHeight, 24 + kLossKeyLine * static_cast<int>(curves.size() + 1));
  std::string svg =
      fmt::format(R"(<svg class="plot" viewBox="0 0 {} {}" role="img" aria-label="Loss terms over {} iterations">)",
                  kLossWidth, height, last);
  svg += fmt::format(R"(<text x="{:.0f}" y="11">loss{}</text>)", kLossLeft, axis.logarithmic ? " (logarithmic)" : "");
  svg += fmt::format(R"(<text x="{}" y="11" text-anchor="end">at the end</text>)", kLossWidth - 4);
  svg += value_axis(axis) + iteration_axis(last);
  // The total is drawn last, over the others.
  for (std::size_t i = curves.size(); i-- > 0;) svg += curve_svg(curves[i], i, axis, last);
  return svg + "</svg>";
}

}  // namespace duet
