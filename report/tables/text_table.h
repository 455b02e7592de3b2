// A table of strings as aligned Markdown, as CSV (RFC 4180) or as the rows of a LaTeX tabular; and one with its title,
// caption and notes.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

struct TextTable {
  std::vector<std::string> header = {};
  std::vector<std::vector<std::string>> rows = {};  // each as long as the header
  std::size_t label_columns = 1;                    // these are set left, the others right
};

struct TitledTable {
  std::string title = {};               // "" for none
  std::string caption = {};             // what all rows have in common, "" for nothing
  TextTable table = {};                 // without rows: the notes say why
  std::vector<std::string> notes = {};  // sentences below it
  std::string group = {};               // tables of one group fold together in HTML; "" for none
  bool too_long_for_terminal = false;
};

// Names that tell the rows of a table apart.
struct LabelColumn {
  std::string title;
  std::vector<std::string> values;  // per row
  bool always = false;              // stays where all rows have the same
};
struct RowLabels {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> cells;  // per row
  std::string caption;                          // what all have in common: "Engine mujoco, controller vmc." or ""
};
RowLabels row_labels(const std::vector<LabelColumn>& columns);
template <typename Row>
LabelColumn label_column(const char* title, const std::vector<Row>& rows, std::string Row::*field,
                         bool always = false) {
  LabelColumn column{title, {}, always};
  for (const Row& row : rows) column.values.push_back(row.*field);
  return column;
}

// A table with these labels and no other column yet.
TitledTable labelled_table(const std::string& title, const RowLabels& labels);

// "### title", caption, table, notes.
std::string markdown_of(const TitledTable& titled);
// A table environment that fits the text of any class (booktabs, graphicx): title and caption as its caption, the
// tabular, set smaller where it is wider than the lines, and the notes below it. Without rows the notes as comments.
std::string latex_of(const TitledTable& titled);
// Its labels and those of these columns that it has, in its own order; all where it has none of them.
TitledTable with_columns(TitledTable titled, const std::vector<std::string>& columns);
// Appends a column; `cell` makes that of the row with a number.
void add_column(const std::string& header, TitledTable& titled, const std::function<std::string(std::size_t)>& cell);

std::string markdown_table(const TextTable& table);
std::string csv_table(const TextTable& table);    // lines end with CR LF
std::string latex_table(const TextTable& table);  // tabular with booktabs rules; cells are escaped

std::string number_cell(double value);  // for CSV: not rounded, "" where it is not finite

std::string escape_latex(std::string_view text);
// The text on one line, without tags and characters that move a terminal's cursor: for prose, not for cells.
std::string escape_markdown(std::string_view text);
// A comment of LaTeX, whatever the text is; ends its line.
std::string latex_comment(std::string_view text);

// Numbers as tables print them; "-" for one that is not finite. A number with an interval that is not finite stands
// alone.

std::string task_title(const std::string& task);    // "high_five" -> "High-five", "all" -> "Overall"
std::string count_cell(long count);                 // "126"
std::string counted(long count, const char* noun);  // "1 clip", "126 clips"
std::string decimals(double value, int digits);     // "0.84" for two
std::string decimals(double value, const Interval& interval, int digits);       // "0.84 [0.71, 0.92]"
std::string percent(double fraction);                                           // "84.9"
std::string percent(double fraction, const Interval& interval);                 // "84.9 [77.6, 90.1]"
std::string points(double difference, const Interval& interval = kNoInterval);  // "+12.3 [4.5, 20.1]"
std::string p_cell(double p);                                                   // "0.034", "<0.001"
std::string p_text(double p);                                                   // "p = 0.034", "p < 0.001"
std::string significant(double value);                                          // four significant digits
// Three significant digits as far as they are decimals, and at most so many of those: "0.162", "13.8", "2260".
std::string short_number(double value, int most_decimals = 3);
std::string short_number(double value, const Interval& interval, int most_decimals = 3);

}  // namespace duet
