#include "duet/report/tables/line_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr std::size_t kLossPoints = 120;  // a report has a plot of many terms for each clip

nlohmann::json numbers_json(const std::vector<double>& values, std::size_t most) {
  const std::size_t count = std::min(values.size(), most);
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = 0; i < count; ++i) {
    const double value = values[count < 2 ? i : i * (values.size() - 1) / (count - 1)];
    list.push_back(number_or_null(std::strtod(fmt::format("{:.{}g}", value, kPlotDigits).c_str(), nullptr)));
  }
  return list;
}

bool has_point(const LineSeries& series) {
  for (std::size_t i = 0; i < series.x.size(); ++i)
    if (std::isfinite(series.x[i]) && std::isfinite(series.y[i])) return true;
  return false;
}

}  // namespace

nlohmann::json plot_json(const LinePlot& plot) {
  const std::size_t most = plot.loss ? kLossPoints : kPlotPoints;
  nlohmann::json list = nlohmann::json::array();
  const std::vector<double>* last = nullptr;
  for (const LineSeries& series : plot.series) {
    require(series.x.size() == series.y.size(), "line plot '{}': series '{}' has {} x but {} y", plot.title,
            series.name, series.x.size(), series.y.size());
    if (!has_point(series)) continue;
    nlohmann::json& json = list.emplace_back(nlohmann::json{{"name", series.name}});
    if (last == nullptr || *last != series.x) json["x"] = numbers_json(series.x, most);
    json["y"] = numbers_json(series.y, most);
    last = &series.x;
  }
  if (list.empty()) return nullptr;
  return {{"title", plot.title},
          {"x_label", plot.x_label},
          {"y_label", plot.y_label},
          {"loss", plot.loss},
          {"series", std::move(list)}};
}

std::string escape_html(std::string_view text) {
  std::string escaped;
  escaped.reserve(text.size());
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

}  // namespace duet
