// Rows of a table that people or their programs wrote as text. The first line with something on it tells what stands
// between fields: semicolons, tabs, commas, or blanks where there is none of the three. A byte order mark, any line
// ends, quotes (RFC 4180), lines that begin with '#', Excel's "sep=;" and delimiters at the ends of lines beyond the
// columns are taken. Not thread-safe.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

class CsvReader {
 public:
  // `text` outlives the reader. `name`: of the file, for messages.
  CsvReader(std::string_view text, std::string name);

  // Goes on to the next row; false at the end. Empty lines and comments are no rows, a row of empty fields is one.
  // Throws InputError naming file and line: more than 4096 fields, a quote that is not closed.
  bool next();

  // The fields of the row, without blanks around them; at least one. Valid until next().
  [[nodiscard]] std::span<const std::string> fields() const { return {fields_.data(), count_}; }
  [[nodiscard]] bool blank() const;                 // no field has anything in it
  [[nodiscard]] int line() const { return line_; }  // where the row begins, from 1
  [[nodiscard]] const std::vector<std::string_view>& comments() const { return comments_; }  // so far, with their '#'

  // The finite number that the field is; where fields are not divided by commas, "0,5" is one, too.
  [[nodiscard]] std::optional<double> number(std::string_view field) const;

  // Throws InputError: "'NAME': line N: FAULT"; before the first row without the line.
  [[noreturn]] void fail(const std::string& fault) const;

 private:
  void read_row();
  bool read_field(std::string& field);  // whether another follows
  void read_quoted(std::string& field);
  void take_line_end();
  void cut_empty_ends();

  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0;
  char delimiter_ = '\0';  // not known yet
  int line_ = 0, next_line_ = 1;
  std::vector<std::string> fields_;  // of which the first `count_` are the row's
  std::size_t count_ = 0, width_ = 0;
  std::vector<std::string_view> comments_;
};

// Goes on to the first row, which holds these names. Throws InputError naming file, line, both.
void require_header(CsvReader& rows, std::span<const std::string> names);

}  // namespace duet
