#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "duet/app/certificate.h"
#include "duet/report/page/html_page.h"
#include "duet/report/tables/line_plot.h"

namespace duet {
namespace {

constexpr double kPlotWidth = 560.0, kPlotHeight = 300.0, kLeft = 64.0, kRight = 440.0, kTop = 14.0, kBottom = 252.0;
constexpr double kDotRadius = 3.6, kKeyLine = 18.0;
constexpr int kColours = 8;  // --t1 to --t8 of the style sheet

constexpr const char* kStyle = R"css(
.plots{grid-template-columns:repeat(auto-fill,minmax(480px,1fr))}
figcaption b{display:block}
tbody td{white-space:normal}
@media(max-width:560px){.plots{grid-template-columns:1fr}}
)css";

constexpr const char* kPictureStyle = R"css(
svg{--t1:#0072b2;--t2:#d55e00;--t3:#009e73;--t4:#cc79a7;--t5:#8a6d00;--t6:#3f8fc4;--t7:#666;--t8:#444}
text{font:12px system-ui,sans-serif;fill:#555}text.title{font-weight:700;font-size:14px;fill:#222}.grid{stroke:#ddd}
polyline{fill:none;stroke-width:1.6}
@media(prefers-color-scheme:dark){text{fill:#a6adb6}text.title{fill:#e7e8ea}.grid{stroke:#3a4048}}
)css";

// An axis of decades: its range and ticks are whole ones.
struct DecadeAxis {
  double from, to;                                                                // [px], of the lowest and the highest
  double low = std::numeric_limits<double>::infinity(), high = -low, step = 1.0;  // decimal logarithms

  void take(double value) {
    low = std::min(low, std::floor(std::log10(value)));
    high = std::max(high, std::max(std::ceil(std::log10(value)), low + 1.0));
  }
  // Ticks of two or more decades where there are more than `most`.
  void thin(int most) { step = std::max(1.0, std::ceil((high - low) / most)); }
  [[nodiscard]] bool empty() const { return low > high; }
  [[nodiscard]] double at(double value) const { return from + (to - from) * (std::log10(value) - low) / (high - low); }
  [[nodiscard]] std::vector<double> ticks() const {
    std::vector<double> values;
    for (double decade = low; decade <= high; decade += step) values.push_back(std::pow(10.0, decade));
    return values;
  }
  static std::string label(double tick) {
    const double decade = std::round(std::log10(tick));
    return std::abs(decade) <= 3.0 ? fmt::format("{:g}", std::pow(10.0, decade)) : fmt::format("1e{:g}", decade);
  }
};

bool plottable(const conformance::AccuracyPoint& point) {
  return std::isfinite(point.error) && point.error > 0.0 && std::isfinite(point.cost) && point.cost > 0.0;
}

const AccuracyCurve* curve_of(const CertifiedEngine& engine, const std::string& scene) {
  const auto found = std::find_if(engine.accuracy.begin(), engine.accuracy.end(),
                                  [&](const AccuracyCurve& curve) { return curve.scene == scene; });
  return found == engine.accuracy.end() ? nullptr : &*found;
}

std::string grid_svg(const DecadeAxis& x, const DecadeAxis& y) {
  std::string svg;
  for (const double tick : x.ticks())
    svg +=
        fmt::format(R"(<line class="grid" x1="{0:.1f}" y1="{1}" x2="{0:.1f}" y2="{2}"/>)", x.at(tick), kTop, kBottom);
  for (const double tick : x.ticks())
    svg += fmt::format(R"(<text x="{:.1f}" y="{:.0f}" text-anchor="middle">{}</text>)", x.at(tick), kBottom + 17.0,
                       DecadeAxis::label(tick));
  svg += fmt::format(R"(<text x="{:.0f}" y="{:.0f}" text-anchor="middle">CPU seconds per simulated second</text>)",
                     (x.from + x.to) / 2.0, kBottom + 35.0);
  for (const double tick : y.ticks())
    svg += fmt::format(
        R"(<line class="grid" x1="{0:.0f}" x2="{1:.0f}" y1="{2:.1f}" y2="{2:.1f}"/><text x="{3:.0f}" y="{4:.1f}" text-anchor="end">{5}</text>)",
        kLeft, kRight, y.at(tick), kLeft - 7.0, y.at(tick) + 4.0, DecadeAxis::label(tick));
  return svg;
}

std::string curve_svg(const CertifiedEngine& engine, const AccuracyCurve& curve, int colour, const DecadeAxis& x,
                      const DecadeAxis& y) {
  std::string points, dots;
  for (const conformance::AccuracyPoint& point : curve.points) {
    if (!plottable(point)) continue;
    points += fmt::format("{:.1f},{:.1f} ", x.at(point.cost), y.at(point.error));
    dots += fmt::format(
        R"svg(<circle cx="{:.1f}" cy="{:.1f}" r="{}" style="fill:var(--t{})"><title>{}, {:g} ms: {:.3g} {} at {:.3g} CPU s/s</title></circle>)svg",
        x.at(point.cost), y.at(point.error), kDotRadius, colour, escape_html(engine.name), 1e3 * point.dt, point.error,
        escape_html(curve.unit), point.cost);
  }
  return fmt::format(R"svg(<polyline points="{}" style="stroke:var(--t{})"/>)svg", points, colour) + dots;
}

int colour_of(std::size_t engine) { return 1 + static_cast<int>(engine % kColours); }

std::string key_svg(const std::vector<CertifiedEngine>& engines, const std::string& scene) {
  std::string svg;
  double line = kTop + 12.0;
  for (std::size_t i = 0; i < engines.size(); ++i) {
    if (curve_of(engines[i], scene) == nullptr) continue;
    svg += fmt::format(R"svg(<circle cx="{}" cy="{}" r="{}" style="fill:var(--t{})"/>)svg", kRight + 18.0, line - 4.0,
                       kDotRadius, colour_of(i));
    svg +=
        fmt::format(R"(<text class="key" x="{}" y="{}">{}</text>)", kRight + 28.0, line, escape_html(engines[i].name));
    line += kKeyLine;
  }
  return svg;
}

std::vector<std::string> plotted_scenes(const Certificate& certificate) {
  std::vector<std::string> scenes;
  for (const CertifiedEngine& engine : certificate.engines)
    for (const AccuracyCurve& curve : engine.accuracy)
      if (std::find(scenes.begin(), scenes.end(), curve.scene) == scenes.end()) scenes.push_back(curve.scene);
  return scenes;
}

const AccuracyCurve& first_curve(const Certificate& certificate, const std::string& scene) {
  for (const CertifiedEngine& engine : certificate.engines)
    if (const AccuracyCurve* curve = curve_of(engine, scene); curve != nullptr) return *curve;
  return certificate.engines.front().accuracy.front();
}

std::string plots_html(const Certificate& certificate) {
  std::string figures;
  for (const std::string& scene : plotted_scenes(certificate)) {
    const std::string svg = accuracy_plot_svg(certificate.engines, scene);
    if (svg.empty()) continue;
    const AccuracyCurve& curve = first_curve(certificate, scene);
    figures += fmt::format("<figure><figcaption><b>{}</b><span>{}{}</span></figcaption>{}</figure>\n",
                           escape_html(scene), escape_html(curve.error),
                           curve.unit.empty() ? "" : fmt::format(" [{}]", escape_html(curve.unit)), svg);
  }
  if (figures.empty()) return "";
  return fmt::format(
      "<section id=\"plots\"><h2>Error against cost</h2><p>Each dot is one step size; from one dot to the next the "
      "step is "
      "halved. Lower is more accurate, further left is cheaper. Point at a dot for its figures.</p>"
      "<div class=\"plots\">\n{}</div></section>\n",
      figures);
}

std::string section_html(const std::string& id, const TitledTable& titled) {
  return fmt::format("<section id=\"{}\"><h2>{}</h2>{}</section>\n", id, escape_html(titled.title),
                     titled_table_html({.caption = titled.caption, .table = titled.table}));
}

std::string summary_html(const Certificate& certificate) {
  TitledTable titled{.title = "Engines"};
  titled.table = {
      .header = {"Engine", "Version", "Profile", "Step [ms]", "Passed", "Asserted deviations", "Failed", "Unsupported"},
      .label_columns = 3};
  for (const CertifiedEngine& engine : certificate.engines)
    titled.table.rows.push_back({engine.name, engine.version, engine.profile, fmt::format("{:g}", 1e3 * engine.dt),
                                 fmt::format("{}", engine.tally.passed), fmt::format("{}", engine.tally.deviations),
                                 fmt::format("{}", engine.tally.failed), fmt::format("{}", engine.tally.unsupported)});
  return section_html("engines", titled);
}

std::string deviations_html(const Certificate& certificate) {
  if (certificate.deviations.empty()) return "";
  TitledTable titled{
      .title = "Asserted deviations",
      .caption = "Known differences: the suite expects them up to their bound, and fails where one is gone."};
  titled.table = {.header = {"Engine", "Scene", "Quantity", "Bound", "Reason"}, .label_columns = 3};
  for (const CertifiedDeviation& entry : certificate.deviations)
    titled.table.rows.push_back(
        {entry.engine, entry.scene, entry.quantity, fmt::format("{:g}", entry.bound), entry.reason});
  return section_html("deviations", titled);
}

std::string engine_html(const CertifiedEngine& engine) {
  TitledTable titled{.title = engine.name, .caption = engine.version};
  titled.table = {
      .header = {"Scene", "Quantity", "Step [ms]", "Found", "Expected", "Tolerance", "Unit", "Verdict", "Against"},
      .label_columns = 2};
  for (const CertifiedMeasurement& entry : engine.measurements) {
    const conformance::Measurement& found = entry.found;
    titled.table.rows.push_back({found.scene, found.quantity, fmt::format("{:g}", 1e3 * found.dt),
                                 fmt::format("{:.4g}", found.value), fmt::format("{:.4g}", found.expected),
                                 fmt::format("{:.2g}{}", found.relative ? 100.0 * found.tolerance : found.tolerance,
                                             found.relative ? " %" : ""),
                                 found.unit, std::string(conformance::to_string(entry.verdict)), found.note});
  }
  return section_html(escape_html(engine.name), titled);
}

std::string navigation_html(const Certificate& certificate) {
  std::string items = "<li><a href=\"#plots\">Error against cost</a></li>";
  if (!certificate.deviations.empty()) items += "<li><a href=\"#deviations\">Asserted deviations</a></li>";
  for (const CertifiedEngine& engine : certificate.engines)
    items += fmt::format("<li><a href=\"#{0}\">{0}</a></li>", escape_html(engine.name));
  return fmt::format("<nav><ul>{}</ul></nav>\n", items);
}

}  // namespace

std::string accuracy_plot_svg(const std::vector<CertifiedEngine>& engines, const std::string& scene) {
  DecadeAxis x{.from = kLeft, .to = kRight}, y{.from = kBottom, .to = kTop};
  for (const CertifiedEngine& engine : engines) {
    const AccuracyCurve* curve = curve_of(engine, scene);
    if (curve == nullptr) continue;
    for (const conformance::AccuracyPoint& point : curve->points) {
      if (!plottable(point)) continue;
      x.take(point.cost);
      y.take(point.error);
    }
  }
  if (x.empty()) return "";
  x.thin(20);
  y.thin(8);
  std::string svg =
      fmt::format(R"(<svg class="plot" viewBox="0 0 {} {}" role="img" aria-label="{}: error against cost">)",
                  kPlotWidth, kPlotHeight, escape_html(scene));
  svg += grid_svg(x, y);
  for (std::size_t i = 0; i < engines.size(); ++i)
    if (const AccuracyCurve* curve = curve_of(engines[i], scene); curve != nullptr)
      svg += curve_svg(engines[i], *curve, colour_of(i), x, y);
  return svg + key_svg(engines, scene) + "</svg>";
}

std::string parity_svg(const Certificate& certificate) {
  constexpr const char* kScenes[] = {"free-flight", "chain", "saturation", "rolling-ball"};
  constexpr double kTitle = 44.0;
  std::string panels;
  int panel = 0;
  for (const char* scene : kScenes) {
    std::string plot = accuracy_plot_svg(certificate.engines, scene);
    if (plot.empty()) continue;
    const int row = panel / 2, column = panel % 2;
    const double x = column * kPlotWidth, y = row * (kPlotHeight + kTitle);
    const AccuracyCurve& curve = first_curve(certificate, scene);
    panels += fmt::format(R"(<text class="title" x="{0}" y="{1}">{3}</text><text x="{0}" y="{2}">{4}{5}</text>)",
                          x + 12.0, y + 20.0, y + 37.0, scene, escape_html(curve.error),
                          curve.unit.empty() ? "" : " [" + escape_html(curve.unit) + "]");
    plot.insert(4, fmt::format(R"( x="{}" y="{}" width="{}" height="{}")", x, y + kTitle, kPlotWidth, kPlotHeight));
    panels += plot;
    ++panel;
  }
  if (panel == 0) return "";
  const int rows = (panel + 1) / 2;
  const double width = std::min(panel, 2) * kPlotWidth, height = rows * (kPlotHeight + kTitle);
  return fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\"><style>{}</style>{}</svg>\n",
                     width, height, kPictureStyle, panels);
}

std::string parity_page(const Certificate& certificate, const std::string& style) {
  std::string html = fmt::format(
      "<header><h1>Parity of physics engines</h1><p class=\"machine\">duet {} · {} · effort {} · {}</p>"
      "<p>The same robots, scenes, torque law and contacts in every engine, each against a closed form or against our "
      "own integration. <code>duet validate --effort {}</code> makes this page again.</p></header>\n",
      escape_html(certificate.program), escape_html(certificate.machine), escape_html(certificate.effort),
      escape_html(certificate.created_at), escape_html(certificate.effort));
  html += navigation_html(certificate) + "<main>\n" + summary_html(certificate) + plots_html(certificate) +
          deviations_html(certificate);
  for (const CertifiedEngine& engine : certificate.engines) html += engine_html(engine);
  html += fmt::format("</main><footer>Digest {}</footer>", escape_html(certificate.digest));
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\"><title>duet: "
      "parity of physics engines</title><style>{}{}</style></head><body>\n{}</body></html>\n",
      style, kStyle, html);
}

}  // namespace duet
