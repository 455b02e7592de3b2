#include "duet/report/tables/estimate.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "duet/report/tables/text_table.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

struct TextColumn {
  const char* name;
  std::string Estimate::*value;
};
constexpr std::array<TextColumn, 10> kKeys = {{{"source", &Estimate::source},
                                               {"engine", &Estimate::engine},
                                               {"controller", &Estimate::controller},
                                               {"policy", &Estimate::policy},
                                               {"arm", &Estimate::arm},
                                               {"perturbation", &Estimate::perturbation},
                                               {"task", &Estimate::task},
                                               {"of", &Estimate::of},
                                               {"name", &Estimate::name},
                                               {"unit", &Estimate::unit}}};

std::string whole_cell(const std::optional<long>& number) { return number ? fmt::format("{}", *number) : ""; }

nlohmann::json estimate_json(const Estimate& estimate) {
  nlohmann::json json = nlohmann::json::object();
  for (const TextColumn& key : kKeys)
    if (!(estimate.*key.value).empty()) json[key.name] = estimate.*key.value;
  if (estimate.n) json["n"] = *estimate.n;
  if (estimate.k) json["k"] = *estimate.k;
  if (!estimate.text.empty()) {
    json["text"] = estimate.text;
    return json;
  }
  json["value"] = number_or_null(estimate.value);
  if (!std::isfinite(estimate.interval.low)) return json;
  json["low"] = estimate.interval.low;
  json["high"] = number_or_null(estimate.interval.high);
  return json;
}

}  // namespace

Rate make_rate(long k, long n, double level) {
  if (n == 0) return {};
  return {.n = n, .k = k, .rate = static_cast<double>(k) / static_cast<double>(n), .interval = wilson(k, n, level)};
}

void EstimatesOf::add(std::string_view name, std::optional<long> n, double value, const Interval& interval,
                      std::string_view unit) const {
  Estimate& estimate = into.emplace_back(keys);
  estimate.name = name;
  estimate.unit = unit;
  estimate.n = n;
  estimate.value = value;
  estimate.interval = interval;
}

void EstimatesOf::rate(std::string_view name, const Rate& rate) const {
  add(name, rate.n, rate.rate, rate.interval);
  into.back().k = rate.k;
}

void EstimatesOf::count(std::string_view name, std::optional<long> n, long count) const {
  add(name, n, static_cast<double>(count));
}

void EstimatesOf::word(std::string_view name, const std::string& text) const {
  add(name, {}, std::numeric_limits<double>::quiet_NaN(), kNoInterval, "");
  into.back().text = text;
}

std::string estimates_csv(std::string_view analysis, double level, const Estimates& estimates) {
  TextTable table;
  table.header = {"analysis"};
  for (const TextColumn& key : kKeys) table.header.emplace_back(key.name);
  for (const char* name : {"n", "k", "value", "low", "high", "level", "text"}) table.header.emplace_back(name);
  for (const Estimate& estimate : estimates) {
    std::vector<std::string>& cells = table.rows.emplace_back(1, std::string(analysis));
    for (const TextColumn& key : kKeys) cells.push_back(estimate.*key.value);
    const bool has_interval = std::isfinite(estimate.interval.low);
    cells.insert(cells.end(), {whole_cell(estimate.n), whole_cell(estimate.k), number_cell(estimate.value),
                               number_cell(estimate.interval.low), number_cell(estimate.interval.high),
                               has_interval ? number_cell(level) : "", estimate.text});
  }
  return csv_table(table);
}

nlohmann::json estimates_json(const Estimates& estimates) {
  nlohmann::json list = nlohmann::json::array();
  for (const Estimate& estimate : estimates) list.push_back(estimate_json(estimate));
  return list;
}

}  // namespace duet
