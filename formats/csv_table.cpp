#include "duet/formats/csv_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "duet/core/number.h"
#include "duet/core/require.h"
#include "duet/core/split.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kMostColumns = 4096;

void read_meta(std::string_view line, CsvTable& table) {
  const std::string_view text = trimmed(line.substr(1));
  const std::size_t mark = text.find_first_of(":=");
  if (mark != std::string_view::npos)
    table.meta.emplace(std::string(trimmed(text.substr(0, mark))), std::string(trimmed(text.substr(mark + 1))));
}

class TableReader {
 public:
  explicit TableReader(const std::string& name) { table_.name = name; }

  void take(std::string_view line, int number) {
    if (line.front() == '#') return read_meta(line, table_);
    fields_ = split(line, ',');
    for (std::string_view& field : fields_) field = trimmed(field);
    if (fields_.size() > kMostColumns)
      fail(number, fmt::format("expected at most {} columns, found {}", kMostColumns, fields_.size()));
    if (values_.empty() && table_.columns.empty() && names_columns()) return take_names(number);
    if (width_ == 0) width_ = fields_.size();
    if (fields_.size() != width_)
      fail(number, fmt::format("expected {} columns as in the lines before, found {}", width_, fields_.size()));
    for (std::size_t c = 0; c < width_; ++c) take_number(number, c);
  }

  CsvTable finish() {
    if (values_.empty()) throw InputError(fmt::format("'{}': expected lines of numbers, found none", table_.name));
    const auto rows = static_cast<Eigen::Index>(values_.size() / width_);
    table_.values = Eigen::Map<const Eigen::MatrixXd>(values_.data(), static_cast<Eigen::Index>(width_), rows);
    return std::move(table_);
  }

 private:
  [[noreturn]] void fail(int line, const std::string& fault) const {
    throw InputError(fmt::format("'{}': line {}: {}", table_.name, line, fault));
  }

  // Text that is no number; "nan" and "inf" are numbers that are refused later.
  [[nodiscard]] bool names_columns() const {
    return std::any_of(fields_.begin(), fields_.end(), [](std::string_view field) {
      const bool letters = field.find_first_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_") == 0;
      return letters && field != "nan" && field != "inf" && field != "NaN";
    });
  }

  void take_names(int line) {
    width_ = fields_.size();
    for (const std::string_view field : fields_) {
      if (std::find(table_.columns.begin(), table_.columns.end(), field) != table_.columns.end())
        fail(line, fmt::format("column '{}' stands twice", shown(field)));
      table_.columns.emplace_back(field);
    }
  }

  void take_number(int line, std::size_t column) {
    const std::optional<double> value = parse_number(fields_[column]);
    if (!value)
      fail(line, fmt::format("column {}: expected a finite number, found '{}'", column + 1, shown(fields_[column])));
    values_.push_back(*value);
  }

  CsvTable table_;
  std::vector<std::string_view> fields_;
  std::vector<double> values_;
  std::size_t width_ = 0;
};

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
  TableReader reader(name);
  int number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = trimmed(text.substr(begin, end - begin));
    ++number;
    if (!line.empty()) reader.take(line, number);
    begin = end + 1;
  }
  return reader.finish();
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
