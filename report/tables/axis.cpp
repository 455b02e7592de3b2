#include "duet/report/tables/axis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/report/tables/escape_html.h"

namespace duet {

void PlotAxis::take(double value) {
  const double drawn = logarithmic ? std::log10(value) : value;
  low = std::min(low, drawn);
  high = std::max(high, drawn);
}

void PlotAxis::round(int intervals) {
  if (high - low <= 1e-12 * std::max(std::abs(high), std::abs(low))) {
    const double room = high == 0.0 ? 1.0 : 0.1 * std::abs(high);
    low -= room;
    high += room;
  }
  step = nice_step(high - low, intervals);
  low = std::floor(low / step + 1e-9) * step;
  high = std::ceil(high / step - 1e-9) * step;
}

void PlotAxis::round_decades(int most) {
  low = std::floor(low);
  high = std::max(std::ceil(high), low + 1.0);
  step = std::max(1.0, std::ceil((high - low) / most));
}

double PlotAxis::at(double value) const {
  const double drawn = logarithmic ? std::log10(value) : value;
  return from + (to - from) * (drawn - low) / (high - low);
}

std::vector<double> PlotAxis::ticks() const {
  const double first = logarithmic ? low : std::ceil(low / step - 1e-9) * step;
  std::vector<double> values;
  for (int i = 0; first + i * step <= high + 1e-9 * step; ++i)
    values.push_back(logarithmic ? std::pow(10.0, first + i * step) : first + i * step);
  return values;
}

std::string PlotAxis::label(double tick) const {
  if (logarithmic) {
    const double decade = std::round(std::log10(tick));
    return std::abs(decade) <= 3.0 ? fmt::format("{:g}", std::pow(10.0, decade)) : fmt::format("1e{:g}", decade);
  }
  const double size = std::abs(tick);
  if (size < 1e-9 * step) return "0";
  if (size >= 1e6) return fmt::format("{:g}M", tick / 1e6);
  if (size >= 1e4) return fmt::format("{:g}k", tick / 1e3);
  return fmt::format("{:.{}f}", tick, std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9))));
}

double nice_step(double span, int intervals) {
  const double raw = span / intervals;
  const double decade = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= raw * (1.0 - 1e-9)) return factor * decade;
  }
  return 10.0 * decade;
}

std::string grid_lines(const PlotAxis& y, double left, double right) {
  std::string svg;
  for (const double tick : y.ticks()) {
    svg += fmt::format(R"(<line class="grid" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.1f}" y2="{2:.1f}"/>)", left, right,
                       y.at(tick));
    svg += fmt::format(R"(<text x="{:.0f}" y="{:.1f}" text-anchor="end">{}</text>)", left - 7.0, y.at(tick) + 4.0,
                       y.label(tick));
  }
  return svg;
}

std::string axis_ticks(const PlotAxis& x, double bottom, const std::string& name) {
  std::string svg;
  for (const double tick : x.ticks())
    svg += fmt::format(R"(<text x="{:.1f}" y="{:.0f}" text-anchor="middle">{}</text>)", x.at(tick), bottom + 17.0,
                       x.label(tick));
  return svg + fmt::format(R"(<text x="{:.0f}" y="{:.0f}" text-anchor="middle">{}</text>)", (x.from + x.to) / 2.0,
                           bottom + 35.0, escape_html(name));
}

}  // namespace duet
