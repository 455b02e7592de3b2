#include "duet/results/report/training_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/split.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kMostColumns = 1000;
constexpr std::string_view kClockColumn = "minutes";

// Two values or more, all the same.
bool is_level(const std::vector<double>& values) {
  std::vector<double> finite;
  std::ranges::copy_if(values, std::back_inserter(finite), [](double value) { return std::isfinite(value); });
  return finite.size() > 1 && std::ranges::count(finite, finite.front()) == std::ssize(finite);
}

std::vector<std::string> cells_of(std::string_view line) {
  std::vector<std::string> cells;
  for (const std::string_view cell : split(line, ',')) cells.emplace_back(trimmed(cell));
  return cells;
}

std::vector<std::string> read_header(std::string_view line, const std::string& name) {
  std::vector<std::string> columns = cells_of(line);
  if (columns.size() < 2)
    throw InputError(fmt::format("{}:1: expected two or more columns, found {}", name, columns.size()));
  if (columns.size() > kMostColumns)
    throw InputError(fmt::format("{}:1: expected at most {} columns, found {}", name, kMostColumns, columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].empty()) throw InputError(fmt::format("{}:1: column {} has no name", name, i + 1));
    if (std::count(columns.begin(), columns.end(), columns[i]) > 1)
      throw InputError(fmt::format("{}:1: column '{}' is there twice", name, shown(columns[i])));
  }
  return columns;
}

double read_cell(const std::string& cell, const std::string& column, const std::string& place) {
  if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (*end != '\0')
    throw InputError(fmt::format("{}: column '{}': expected a number, found '{}'", place, shown(column), shown(cell)));
  return value;
}

}  // namespace

TrainingCurves parse_curves(std::string_view csv, const std::string& name) {
  TrainingCurves curves{.title = name, .columns = {}, .values = {}};
  int number = 0;
  for (std::size_t begin = 0; begin < csv.size();) {
    const std::size_t end = std::min(csv.find('\n', begin), csv.size());
    const std::string_view line = trimmed(csv.substr(begin, end - begin));
    begin = end + 1;
    ++number;
    if (curves.columns.empty()) {
      curves.columns = read_header(line, name);
      curves.values.resize(curves.columns.size());
      continue;
    }
    if (line.empty()) continue;
    const std::string place = fmt::format("{}:{}", name, number);
    const std::vector<std::string> cells = cells_of(line);
    if (cells.size() != curves.columns.size())
      throw InputError(fmt::format("{}: expected {} cells, found {}", place, curves.columns.size(), cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i)
      curves.values[i].push_back(read_cell(cells[i], curves.columns[i], place));
  }
  if (curves.values.empty() || curves.values.front().empty())
    throw InputError(fmt::format("{}: expected a line of column names and lines of values, found none", name));
  return curves;
}

TrainingCurves load_curves(const std::string& path) { return parse_curves(read_text(path), path); }

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
