#include "duet/formats/csv_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "duet/archives/csv.h"
#include "duet/core/require.h"
#include "duet/core/split.h"
#include "duet/core/text.h"

namespace duet {
namespace {

void read_meta(std::string_view comment, CsvTable& table) {
  const std::string_view text = trimmed(comment.substr(1));
  const std::size_t mark = text.find_first_of(":=");
  if (mark != std::string_view::npos)
    table.meta.emplace(std::string(trimmed(text.substr(0, mark))), std::string(trimmed(text.substr(mark + 1))));
}

// Text that is no number; "nan" and "inf" are numbers that are refused later.
bool names_columns(std::span<const std::string> fields) {
  return std::any_of(fields.begin(), fields.end(), [](const std::string& field) {
    const bool letters = field.find_first_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_") == 0;
    return letters && field != "nan" && field != "inf" && field != "NaN";
  });
}

std::vector<std::string> column_names(const CsvReader& rows) {
  std::vector<std::string> columns;
  for (const std::string& field : rows.fields()) {
    if (std::find(columns.begin(), columns.end(), field) != columns.end())
      rows.fail(fmt::format("column '{}' stands twice", shown(field)));
    columns.push_back(field);
  }
  return columns;
}

void take_numbers(const CsvReader& rows, std::vector<double>& values) {
  const auto fields = rows.fields();
  for (std::size_t c = 0; c < fields.size(); ++c) {
    const std::optional<double> value = rows.number(fields[c]);
    if (!value) rows.fail(fmt::format("column {}: expected a finite number, found '{}'", c + 1, shown(fields[c])));
    values.push_back(*value);
  }
}

}  // namespace

int CsvTable::find(std::string_view column) const {
  const auto found = std::find(columns.begin(), columns.end(), column);
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

int CsvTable::get(std::string_view column) const {
  if (const int found = find(column); found >= 0) return found;
  throw InputError(fmt::format("'{}': no column '{}'. It has: {}", name, column,
                               shown(fmt::format("{}", fmt::join(columns, ", ")), kShownSentence)));
}

CsvTable parse_csv_table(std::string_view text, const std::string& name) {
  CsvTable table;
  table.name = name;
  std::vector<double> values;
  std::size_t width = 0;
  CsvReader rows(text, name);
  while (rows.next()) {
    if (rows.blank()) continue;
    const bool names = width == 0 && names_columns(rows.fields());
    if (width == 0) width = rows.fields().size();
    if (rows.fields().size() != width)
      rows.fail(fmt::format("expected {} columns as in the lines before, found {}", width, rows.fields().size()));
    if (names)
      table.columns = column_names(rows);
    else
      take_numbers(rows, values);
  }
  for (const std::string_view comment : rows.comments()) read_meta(comment, table);
  if (values.empty()) throw InputError(fmt::format("'{}': expected lines of numbers, found none", name));
  const auto count = static_cast<Eigen::Index>(values.size() / width);
  table.values = Eigen::Map<const Eigen::MatrixXd>(values.data(), static_cast<Eigen::Index>(width), count);
  return table;
}

std::string csv_text(std::span<const std::string> columns, const Eigen::MatrixXd& values) {
  std::string text;
  if (!columns.empty()) text = fmt::format("{}\n", fmt::join(columns, ","));
  for (Eigen::Index row = 0; row < values.cols(); ++row)
    for (Eigen::Index c = 0; c < values.rows(); ++c)
      fmt::format_to(std::back_inserter(text), "{:.9g}{}", values(c, row), c + 1 < values.rows() ? ',' : '\n');
  return text;
}

}  // namespace duet
