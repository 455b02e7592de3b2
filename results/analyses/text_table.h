// A table of strings as aligned Markdown, as CSV (RFC 4180) or as the rows of a LaTeX tabular.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct TextTable {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  // each as long as the header
  std::size_t label_columns = 1;               // these are set left, the others right
};

std::string markdown_table(const TextTable& table);
std::string csv_table(const TextTable& table);    // lines end with CR LF
std::string latex_table(const TextTable& table);  // tabular with booktabs rules; cells are escaped

std::string number_cell(double value);  // for CSV: not rounded, "" where it is not finite

std::string escape_latex(std::string_view text);
// On one line, without tags and without characters that move a terminal's cursor: for prose, not for cells.
std::string escape_markdown(std::string_view text);
// A comment of LaTeX, whatever the text is; ends its line.
std::string latex_comment(std::string_view text);

}  // namespace duet
