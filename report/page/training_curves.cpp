#include "duet/report/page/training_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>

#include "duet/archives/csv.h"
#include "duet/core/data_file.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::string_view kClockColumn = "minutes";

// Two values or more, all the same.
bool is_level(const std::vector<double>& values) {
  std::vector<double> finite;
  std::ranges::copy_if(values, std::back_inserter(finite), [](double value) { return std::isfinite(value); });
  return finite.size() > 1 && std::ranges::count(finite, finite.front()) == std::ssize(finite);
}

std::vector<std::string> read_header(const CsvReader& row) {
  const std::vector<std::string> columns(row.fields().begin(), row.fields().end());
  if (columns.size() < 2) row.fail(fmt::format("expected two or more columns, found {}", columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].empty()) row.fail(fmt::format("column {} has no name", i + 1));
    if (std::count(columns.begin(), columns.end(), columns[i]) > 1)
      row.fail(fmt::format("column '{}' is there twice", shown(columns[i])));
  }
  return columns;
}

// Reads a number of a training's curve: NaN for an empty cell; NaN and infinity as C and Python write them.
double read_cell(const CsvReader& row, const std::string& cell, const std::string& column) {
  if (const std::optional<double> value = row.number(cell)) return *value;
  if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (*end != '\0' || std::isfinite(value))
    row.fail(fmt::format("column '{}': expected a number, found '{}'", shown(column), shown(cell)));
  return value;
}

}  // namespace

TrainingCurves parse_curves(std::string_view csv, const std::string& name) {
  TrainingCurves curves{.title = name, .columns = {}, .values = {}};
  CsvReader rows(csv, name);
  while (rows.next()) {
    if (rows.blank()) continue;
    if (curves.columns.empty()) {
      curves.columns = read_header(rows);
      curves.values.resize(curves.columns.size());
      continue;
    }
    if (rows.fields().size() != curves.columns.size())
      rows.fail(fmt::format("expected {} cells, found {}", curves.columns.size(), rows.fields().size()));
    for (std::size_t i = 0; i < curves.columns.size(); ++i)
      curves.values[i].push_back(read_cell(rows, rows.fields()[i], curves.columns[i]));
  }
  if (curves.values.empty() || curves.values.front().empty())
    throw InputError(fmt::format("'{}': expected a line of column names and lines of values, found none", shown(name)));
  return curves;
}

TrainingCurves load_curves(const std::string& path) { return parse_curves(read_plain_text(path), path); }

std::vector<LinePlot> curve_plots(const TrainingCurves& curves) {
  std::vector<LinePlot> plots;
  for (std::size_t i = 1; i < curves.columns.size(); ++i) {
    if (curves.columns[i] == kClockColumn || is_level(curves.values[i])) continue;
    plots.push_back({.title = fmt::format("{} against {}", curves.columns[i], curves.columns[0]),
                     .x_label = curves.columns[0],
                     .y_label = curves.columns[i],
                     .series = {{curves.columns[i], curves.values[0], curves.values[i]}}});
  }
  return plots;
}

}  // namespace duet
