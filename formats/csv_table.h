// Tables of numbers in any dialect of CSV (archives/csv.h): an optional line of names, lines that begin with '#' for
// what else is known. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct CsvTable {
  std::string name;                         // of the file, for messages
  std::vector<std::string> columns;         // empty where no line names them
  std::map<std::string, std::string> meta;  // of lines "# key: value" and "# key = value"
  Eigen::MatrixXd values;                   // (columns, rows): one column of the matrix is one line of the file

  [[nodiscard]] int rows() const { return static_cast<int>(values.cols()); }
  // Row of `values` by the name of the column; -1 where there is none.
  [[nodiscard]] int find(std::string_view column) const;
  // Throws InputError naming the file, the column and those that are there.
  [[nodiscard]] int get(std::string_view column) const;
};

// The first line with text that is not a number names the columns. Throws InputError naming file, line and column: no
// line, a field that is no finite number, lines of different length, a name that stands twice.
CsvTable parse_csv_table(std::string_view text, const std::string& name);

// `values` as above, nine significant digits, one line each.
std::string csv_text(std::span<const std::string> columns, const Eigen::MatrixXd& values);

}  // namespace duet
