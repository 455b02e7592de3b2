#include "duet/report/tables/figure.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "duet/report/tables/text_table.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

struct TextColumn {
  const char* name;
  std::string Figure::*value;
};
constexpr std::array<TextColumn, 10> kKeys = {{{"source", &Figure::source},
                                               {"engine", &Figure::engine},
                                               {"controller", &Figure::controller},
                                               {"policy", &Figure::policy},
                                               {"arm", &Figure::arm},
                                               {"perturbation", &Figure::perturbation},
                                               {"task", &Figure::task},
                                               {"of", &Figure::of},
                                               {"name", &Figure::name},
                                               {"unit", &Figure::unit}}};

std::string whole_cell(const std::optional<long>& number) { return number ? fmt::format("{}", *number) : ""; }

nlohmann::json figure_json(const Figure& figure) {
  nlohmann::json json = nlohmann::json::object();
  for (const TextColumn& key : kKeys)
    if (!(figure.*key.value).empty()) json[key.name] = figure.*key.value;
  if (figure.n) json["n"] = *figure.n;
  if (figure.k) json["k"] = *figure.k;
  if (!figure.text.empty()) {
    json["text"] = figure.text;
    return json;
  }
  json["value"] = number_or_null(figure.value);
  if (!std::isfinite(figure.interval.low)) return json;
  json["low"] = figure.interval.low;
  json["high"] = number_or_null(figure.interval.high);
  return json;
}

}  // namespace

Rate make_rate(long k, long n, double level) {
  if (n == 0) return {};
  return {.n = n, .k = k, .rate = static_cast<double>(k) / static_cast<double>(n), .interval = wilson(k, n, level)};
}

void FiguresOf::add(std::string_view name, std::optional<long> n, double value, const Interval& interval,
                    std::string_view unit) const {
  Figure& figure = into.emplace_back(keys);
  figure.name = name;
  figure.unit = unit;
  figure.n = n;
  figure.value = value;
  figure.interval = interval;
}

void FiguresOf::rate(std::string_view name, const Rate& rate) const {
  add(name, rate.n, rate.rate, rate.interval);
  into.back().k = rate.k;
}

void FiguresOf::count(std::string_view name, std::optional<long> n, long count) const {
  add(name, n, static_cast<double>(count));
}

void FiguresOf::word(std::string_view name, const std::string& text) const {
  add(name, {}, std::numeric_limits<double>::quiet_NaN(), kNoInterval, "");
  into.back().text = text;
}

std::string figures_csv(std::string_view analysis, double level, const std::vector<Figure>& figures) {
  TextTable table;
  table.header = {"analysis"};
  for (const TextColumn& key : kKeys) table.header.emplace_back(key.name);
  for (const char* name : {"n", "k", "value", "low", "high", "level", "text"}) table.header.emplace_back(name);
  for (const Figure& figure : figures) {
    std::vector<std::string>& cells = table.rows.emplace_back(1, std::string(analysis));
    for (const TextColumn& key : kKeys) cells.push_back(figure.*key.value);
    const bool has_interval = std::isfinite(figure.interval.low);
    cells.insert(cells.end(), {whole_cell(figure.n), whole_cell(figure.k), number_cell(figure.value),
                               number_cell(figure.interval.low), number_cell(figure.interval.high),
                               has_interval ? number_cell(level) : "", figure.text});
  }
  return csv_table(table);
}

nlohmann::json figures_json(const std::vector<Figure>& figures) {
  nlohmann::json list = nlohmann::json::array();
  for (const Figure& figure : figures) list.push_back(figure_json(figure));
  return list;
}

}  // namespace duet
