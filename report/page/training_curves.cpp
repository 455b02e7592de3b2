#include "duet/report/page/training_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <map>

#include "duet/archives/csv.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/groups/row_groups.h"

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
  std::vector<std::string> columns(row.fields().begin(), row.fields().end());
  if (columns.size() < 2) row.fail(fmt::format("expected two or more columns, found {}", columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].empty()) row.fail(fmt::format("column {} has no name", i + 1));
    if (std::count(columns.begin(), columns.end(), columns[i]) > 1)
      row.fail(fmt::format("column '{}' is there twice", excerpt(columns[i])));
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
    row.fail(fmt::format("column '{}': expected a number, found '{}'", excerpt(column), excerpt(cell)));
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
    throw InputError(
        fmt::format("'{}': expected a line of column names and lines of values, found none", excerpt(name)));
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

namespace {

std::vector<double> metres(const std::vector<int>& millimetres) {
  std::vector<double> values;
  values.reserve(millimetres.size());
  for (const int value : millimetres) values.push_back(value / 1000.0);
  return values;
}

// An episode that ended well before one that did not, a clean one before a perturbed one; else the first.
bool shows_better(const EpisodeRow& a, const EpisodeRow& b) {
  const auto rank = [](const EpisodeRow& row) {
    return (row.outcome == Outcome::kOk ? 0 : 2) + (row.perturbation == "clean" ? 0 : 1);
  };
  return rank(a) < rank(b);
}

}  // namespace

std::vector<LinePlot> foot_plots(const std::vector<EpisodeRow>& rows, const RowFile& file) {
  std::map<std::string, const EpisodeRow*> shown;  // by controller
  for (const EpisodeRow* row : in_episode_order(rows)) {
    if (row->feet.left_mm.empty() || row->arm != "main") continue;
    const auto [found, is_new] = shown.try_emplace(row->controller, row);
    if (!is_new && shows_better(*row, *found->second)) found->second = row;
  }
  std::vector<LinePlot> plots;
  for (const auto& [controller, row] : shown) {
    const FootTrace feet = file.feet(*row);
    std::vector<double> seconds;
    for (std::size_t i = 0; i < feet.left_mm.size(); ++i) seconds.push_back(static_cast<double>(i) / feet.rate_hz);
    plots.push_back(
        {.title = fmt::format("{}: {} in {}, {} policy{}", controller, row->clip, row->engine, row->policy,
                              row->perturbation == "clean" ? "" : ", " + row->perturbation),
         .x_label = "time [s]",
         .y_label = "height of the sole [m]",
         .series = {{"left foot", seconds, metres(feet.left_mm)}, {"right foot", seconds, metres(feet.right_mm)}}});
  }
  return plots;
}

}  // namespace duet
