#include "duet/report/tables/estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

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

namespace {

constexpr std::array<EstimateKey, 6> kOptionalKeys = {&Estimate::engine, &Estimate::controller,   &Estimate::policy,
                                                      &Estimate::arm,    &Estimate::perturbation, &Estimate::task};

bool has_keys(const Estimate& estimate, const Estimate& like) {
  return estimate.name == like.name && std::ranges::all_of(kOptionalKeys, [&](EstimateKey key) {
           return (like.*key).empty() || estimate.*key == like.*key;
         });
}

bool is_papers(const Estimate& estimate) { return estimate.source == "paper"; }

std::string fraction(long k, long n) { return n == 0 ? "-" : fmt::format("{}/{}", k, n); }

std::string text_of(const RowLabel& label, const Estimate& keys) {
  return label.text != nullptr ? label.text(keys) : label_text(keys, label.key);
}

// Labels of our rows; the paper's have "-" for what they lack.
RowLabels pivot_labels(const std::vector<PivotRow>& rows, const std::vector<RowLabel>& labels) {
  const auto papers = std::ranges::find_if(rows, [](const PivotRow& row) { return is_papers(row.keys()); });
  std::vector<LabelColumn> columns;
  for (const RowLabel& label : labels) {
    if (label.title == nullptr) continue;
    LabelColumn& column = columns.emplace_back(LabelColumn{label.title, {}, label.always});
    for (auto row = rows.begin(); row != papers; ++row) column.values.push_back(text_of(label, row->keys()));
  }
  RowLabels made = row_labels(columns);
  for (auto row = papers; row != rows.end(); ++row) {
    std::vector<std::string>& cells = made.cells.emplace_back();
    for (const RowLabel& label : labels) {
      if (label.title == nullptr || std::ranges::find(made.columns, label.title) == made.columns.end()) continue;
      const std::string text = text_of(label, row->keys());
      cells.push_back(text.empty() ? "-" : text);
    }
  }
  return made;
}

}  // namespace

const Estimate* find_estimate(const Estimates& estimates, const Estimate& like) {
  const auto found = std::ranges::find_if(
      estimates, [&](const Estimate& estimate) { return has_keys(estimate, like) && estimate.of == like.of; });
  return found == estimates.end() ? nullptr : &*found;
}

const Estimate* PivotRow::find(const Estimate& like) const {
  const auto found = std::ranges::find_if(estimates, [&](const Estimate* estimate) {
    return has_keys(*estimate, like) && (estimate->of == like.of || (by_of && like.of.empty()));
  });
  return found == estimates.end() ? nullptr : *found;
}

double PivotRow::value(const Estimate& like) const {
  const Estimate* found = find(like);
  return found == nullptr ? std::nan("") : found->value;
}

std::string policy_title(const Estimate& keys) {
  return keys.arm.empty() || keys.arm == "main" ? keys.policy : fmt::format("{} ({} arm)", keys.policy, keys.arm);
}

std::string label_text(const Estimate& keys, EstimateKey key) {
  if (key == &Estimate::task) return task_title(keys.task);
  if (key == &Estimate::policy) return policy_title(keys) + (is_papers(keys) ? " (the paper's)" : "");
  return keys.*key;
}

std::vector<RowLabel> policy_rows(std::vector<RowLabel> more) {
  std::vector<RowLabel> labels = {
      {"Engine", &Estimate::engine}, {"Controller", &Estimate::controller}, {"Policy", &Estimate::policy, true}};
  labels.insert(labels.end(), more.begin(), more.end());
  return labels;
}

PivotColumn column(std::string title, Estimate like, CellText cell, std::string missing) {
  return {std::move(title),
          [like = std::move(like), cell = std::move(cell), missing = std::move(missing)](const PivotRow& row) {
            const Estimate* found = row.find(like);
            return found == nullptr ? missing : cell(*found);
          }};
}

std::string as_percent(const Estimate& estimate) { return percent(estimate.value, estimate.interval); }
std::string as_share(const Estimate& estimate) { return percent(estimate.value); }
std::string as_points(const Estimate& estimate) { return points(estimate.value, estimate.interval); }
std::string as_count(const Estimate& estimate) { return count_cell(std::lround(estimate.value)); }
std::string as_n(const Estimate& estimate) { return count_cell(estimate.n.value_or(0)); }
std::string as_k(const Estimate& estimate) { return count_cell(estimate.k.value_or(0)); }
std::string as_p(const Estimate& estimate) { return p_cell(estimate.value); }
std::string as_word(const Estimate& estimate) { return estimate.text; }
std::string as_significant(const Estimate& estimate) { return significant(estimate.value); }
std::string as_k_of_n(const Estimate& estimate) { return fraction(estimate.k.value_or(0), estimate.n.value_or(0)); }
std::string as_count_of_n(const Estimate& estimate) {
  return fraction(std::lround(estimate.value), estimate.n.value_or(0));
}

CellText as_decimals(int digits) {
  return [digits](const Estimate& estimate) { return decimals(estimate.value, estimate.interval, digits); };
}

CellText as_short(int most_decimals) {
  return [=](const Estimate& estimate) { return short_number(estimate.value, estimate.interval, most_decimals); };
}

std::vector<PivotRow> rows_of(const Estimates& estimates, const std::vector<RowLabel>& labels) {
  std::vector<PivotRow> rows;
  std::map<std::vector<std::string>, std::size_t> places;
  const bool by_of = std::ranges::find(labels, &Estimate::of, &RowLabel::key) != labels.end();
  for (const Estimate& estimate : estimates) {
    std::vector<std::string> key = {estimate.source, estimate.arm};
    bool is_named = true;
    for (const RowLabel& label : labels) {
      key.push_back(estimate.*label.key);
      is_named = is_named && (!label.always || !key.back().empty() || is_papers(estimate));
    }
    if (!is_named) continue;
    const auto [place, is_new] = places.try_emplace(std::move(key), rows.size());
    if (is_new) rows.push_back({.estimates = {}, .by_of = by_of});
    rows[place->second].estimates.push_back(&estimate);
  }
  std::stable_partition(rows.begin(), rows.end(), [](const PivotRow& row) { return !is_papers(row.keys()); });
  return rows;
}

TitledTable table_of(const Estimates& estimates, const Pivot& pivot) {
  const std::vector<PivotRow> rows = rows_of(estimates, pivot.rows);
  TitledTable titled = labelled_table(pivot.title, pivot_labels(rows, pivot.rows));
  for (const PivotColumn& of : pivot.columns)
    add_column(of.title, titled, [&](std::size_t i) { return of.cell(rows[i]); });
  titled.notes = pivot.notes;
  return titled;
}

std::vector<std::string> values_of(const Estimates& estimates, EstimateKey key) {
  std::vector<std::string> values;
  for (const Estimate& estimate : estimates)
    if (!(estimate.*key).empty() && std::ranges::find(values, estimate.*key) == values.end())
      values.push_back(estimate.*key);
  return values;
}

bool has_number(const Estimates& estimates, const Estimate& like) {
  return std::ranges::any_of(estimates, [&](const Estimate& estimate) {
    return has_keys(estimate, like) && (like.of.empty() || estimate.of == like.of) && std::isfinite(estimate.value);
  });
}

}  // namespace duet
