#include "duet/app/parity_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/report/page/report_parts.h"
#include "duet/report/tables/axis.h"
#include "duet/report/tables/escape_html.h"

namespace duet {
namespace {

constexpr double kPlotWidth = 560.0, kPlotHeight = 300.0, kLeft = 64.0, kRight = 440.0, kTop = 14.0, kBottom = 252.0;
constexpr double kDotRadius = 3.6, kKeyLine = 18.0;
constexpr int kColours = 8;  // --t1 to --t8 of the style sheet

constexpr const char* kStyle = R"css(
.plots{display:grid;grid-template-columns:repeat(auto-fill,minmax(480px,1fr));gap:18px 22px;margin-top:14px}
figure{margin:0;border:1px solid var(--line);border-radius:6px;background:var(--panel);padding:12px 14px 6px;break-inside:avoid}
figcaption{font-size:14px;margin-bottom:6px}
figcaption b{display:block}
figcaption span,td.note{color:var(--soft)}
td.note{white-space:normal;text-align:left;min-width:260px;font-size:12.5px}
tr.fail td.verdict{color:var(--human);font-weight:700}
tr.deviation td.verdict{color:var(--other);font-weight:600}
@media(max-width:560px){.plots{grid-template-columns:1fr}}
)css";

constexpr const char* kPictureStyle = R"css(
svg{--t1:#0072b2;--t2:#d55e00;--t3:#009e73;--t4:#cc79a7;--t5:#8a6d00;--t6:#3f8fc4;--t7:#666;--t8:#444}
text{font:12px system-ui,sans-serif;fill:#555}text.title{font-weight:700;font-size:14px;fill:#222}.grid{stroke:#ddd}
polyline{fill:none;stroke-width:1.6}
@media(prefers-color-scheme:dark){text{fill:#a6adb6}text.title{fill:#e7e8ea}.grid{stroke:#3a4048}}
)css";

bool plottable(const conformance::AccuracyPoint& point) {
  return std::isfinite(point.error) && point.error > 0.0 && std::isfinite(point.cost) && point.cost > 0.0;
}

const AccuracyCurve* curve_of(const CertifiedEngine& engine, const std::string& scene) {
  const auto found = std::find_if(engine.accuracy.begin(), engine.accuracy.end(),
                                  [&](const AccuracyCurve& curve) { return curve.scene == scene; });
  return found == engine.accuracy.end() ? nullptr : &*found;
}

std::string grid_svg(const PlotAxis& x, const PlotAxis& y) {
  std::string svg;
  for (const double tick : x.ticks())
    svg +=
        fmt::format(R"(<line class="grid" x1="{0:.1f}" y1="{1}" x2="{0:.1f}" y2="{2}"/>)", x.at(tick), kTop, kBottom);
  return svg + axis_ticks(x, kBottom, "CPU seconds per simulated second") + grid_lines(y, kLeft, kRight);
}

std::string curve_svg(const CertifiedEngine& engine, const AccuracyCurve& curve, int colour, const PlotAxis& x,
                      const PlotAxis& y) {
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

std::string summary_html(const Certificate& certificate) {
  std::string rows;
  for (const CertifiedEngine& engine : certificate.engines)
    rows += fmt::format(
        "<tr><th><a href=\"#{0}\">{0}</a></th><td class=\"l\">{1}</td><td class=\"l\">{2}</td><td>{3:g}</td>"
        "<td>{4}</td><td>{5}</td><td>{6}</td></tr>\n",
        escape_html(engine.name), escape_html(engine.version), escape_html(engine.profile), 1e3 * engine.dt,
        engine.tally.passed, engine.tally.deviations, engine.tally.failed);
  return fmt::format(
      "<section><div class=\"scroll\"><table><thead><tr><th class=\"l\">Engine</th><th class=\"l\">Version</th>"
      "<th class=\"l\">Profile</th><th>Step [ms]</th><th>Passed</th><th>Asserted "
      "deviations</th><th>Failed</th></tr></thead>"
      "<tbody>\n{}</tbody></table></div></section>\n",
      rows);
}

std::string deviations_html(const Certificate& certificate) {
  if (certificate.deviations.empty()) return "";
  std::string rows;
  for (const CertifiedDeviation& entry : certificate.deviations)
    rows += fmt::format(
        "<tr><th>{}</th><td class=\"l\">{}</td><td class=\"l\">{}</td><td>{:g}</td><td class=\"note\">{}</td></tr>\n",
        escape_html(entry.engine), escape_html(entry.scene), escape_html(entry.quantity), entry.bound,
        escape_html(entry.reason));
  return fmt::format(
      "<section id=\"deviations\"><h2>Asserted deviations</h2><p>Known differences: the suite expects them up to their "
      "bound, "
      "and fails where one is gone.</p><div class=\"scroll\"><table><thead><tr><th class=\"l\">Engine</th><th "
      "class=\"l\">Scene"
      "</th><th class=\"l\">Quantity</th><th>Bound</th><th "
      "class=\"l\">Reason</th></tr></thead><tbody>\n{}</tbody></table></div>"
      "</section>\n",
      rows);
}

std::string measurement_row(const CertifiedMeasurement& entry) {
  const conformance::Measurement& found = entry.found;
  const char* style = entry.verdict == conformance::Verdict::kPass   ? ""
                      : entry.verdict == conformance::Verdict::kFail ? " class=\"fail\""
                                                                     : " class=\"deviation\"";
  return fmt::format(
      "<tr{}><th>{}</th><td class=\"l\">{}</td><td>{:g}</td><td>{:.4g}</td><td>{:.4g}</td><td>{:.2g}{}</td>"
      "<td class=\"l\">{}</td><td class=\"l verdict\">{}</td><td class=\"note\">{}</td></tr>\n",
      style, escape_html(found.scene), escape_html(found.quantity), 1e3 * found.dt, found.value, found.expected,
      found.relative ? 100.0 * found.tolerance : found.tolerance, found.relative ? " %" : "", escape_html(found.unit),
      conformance::to_string(entry.verdict), escape_html(found.note));
}

std::string engine_html(const CertifiedEngine& engine) {
  std::string rows;
  for (const CertifiedMeasurement& entry : engine.measurements) rows += measurement_row(entry);
  return fmt::format(
      "<section id=\"{0}\"><h2>{0} <span class=\"unit\">{1}</span></h2><div class=\"scroll\"><table "
      "class=\"compact\"><thead><tr>"
      "<th class=\"l\">Scene</th><th class=\"l\">Quantity</th><th>Step "
      "[ms]</th><th>Found</th><th>Expected</th><th>Tolerance</th>"
      "<th class=\"l\">Unit</th><th class=\"l\">Verdict</th><th "
      "class=\"l\">Against</th></tr></thead><tbody>\n{2}</tbody></table>"
      "</div></section>\n",
      escape_html(engine.name), escape_html(engine.version), rows);
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
  PlotAxis x{.from = kLeft, .to = kRight, .logarithmic = true}, y{.from = kBottom, .to = kTop, .logarithmic = true};
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
  x.round_decades(20);
  y.round_decades(8);
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

std::string parity_page(const Certificate& certificate) {
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><title>duet: parity of physics "
      "engines</title><style>{}{}</style></head>"
      "<body>\n",
      report_style(), kStyle);
  html += fmt::format(
      "<header><h1>Parity of physics engines</h1><p class=\"machine\">duet {} · {} · effort {} · {}</p>"
      "<p>The same robots, scenes, torque law and contacts in every engine, each against a closed form or against our "
      "own "
      "integration. <code>duet validate --effort {}</code> makes this page again.</p></header>\n",
      escape_html(certificate.program), escape_html(certificate.machine), escape_html(certificate.effort),
      escape_html(certificate.created_at), escape_html(certificate.effort));
  html += navigation_html(certificate) + "<main>\n" + summary_html(certificate) + plots_html(certificate) +
          deviations_html(certificate);
  for (const CertifiedEngine& engine : certificate.engines) html += engine_html(engine);
  return html + fmt::format("</main><footer>Digest {}</footer></body></html>\n", escape_html(certificate.digest));
}

}  // namespace duet
