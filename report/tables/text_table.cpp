#include "duet/report/tables/text_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

// Characters, not bytes, so that columns with accents align.
std::size_t width(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

// A '<' opens a tag only before these; "<0.001" stays readable as text.
bool opens_tag(std::string_view rest) {
  if (rest.size() < 2) return false;
  const char next = rest[1];
  return (next >= 'a' && next <= 'z') || (next >= 'A' && next <= 'Z') || next == '/' || next == '!' || next == '?';
}

// Line breaks become spaces, other control characters are spelt out.
std::string one_line(std::string_view text) {
  std::string line(text);
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  return excerpt(line, std::string::npos);
}

std::string escape_markdown_cell(std::string_view text) {
  std::string escaped;
  for (const char c : escape_markdown(text)) escaped += c == '|' ? std::string("\\|") : std::string{c};
  return escaped;
}

// A spreadsheet computes a cell that begins so, unless it is a number.
bool is_formula(std::string_view text) {
  return text.size() > 1 && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos &&
         !parse_number(text.substr(text.front() == '+' ? 1 : 0));
}

std::string escape_csv(std::string_view text) {
  if (is_formula(text)) return escape_csv(fmt::format("'{}", text));
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

std::string padded(const std::string& cell, std::size_t to, bool left) {
  const std::string space(to - std::min(to, width(cell)), ' ');
  return left ? cell + space : space + cell;
}

std::string markdown_line(const std::vector<std::string>& cells, const std::vector<std::size_t>& widths,
                          std::size_t label_columns) {
  std::string line = "|";
  for (std::size_t i = 0; i < cells.size(); ++i)
    line.append(" ").append(padded(cells[i], widths[i], i < label_columns)).append(" |");
  return line + "\n";
}

template <typename Escape>
std::vector<std::vector<std::string>> escaped_lines(const TextTable& table, Escape escape) {
  std::vector<std::vector<std::string>> lines = {table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  for (std::vector<std::string>& line : lines) {
    for (std::string& cell : line) cell = escape(cell);
  }
  return lines;
}

std::string joined_cells(const std::vector<std::string>& cells, const char* separator) {
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i) line.append(i == 0 ? "" : separator).append(cells[i]);
  return line;
}

}  // namespace

std::string escape_markdown(std::string_view text) {
  const std::string line = one_line(text);
  std::string escaped;
  for (std::size_t i = 0; i < line.size(); ++i)
    escaped +=
        line[i] == '<' && opens_tag(std::string_view(line).substr(i)) ? std::string("&lt;") : std::string{line[i]};
  return escaped;
}

std::string latex_comment(std::string_view text) { return "% " + one_line(text) + "\n"; }

std::string markdown_table(const TextTable& table) {
  const auto lines = escaped_lines(table, escape_markdown_cell);
  std::vector<std::size_t> widths(table.header.size(), 3);
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], width(line[i]));
  }
  std::string rule = "|";
  for (std::size_t i = 0; i < widths.size(); ++i) {
    const bool left = i < table.label_columns;
    rule.append(left ? " :" : " ").append(widths[i] - 1, '-').append(left ? " |" : ": |");
  }
  std::string text = markdown_line(lines.front(), widths, table.label_columns) + rule + "\n";
  for (std::size_t i = 1; i < lines.size(); ++i) text += markdown_line(lines[i], widths, table.label_columns);
  return text;
}

std::string csv_table(const TextTable& table) {
  std::string text;
  for (const auto& line : escaped_lines(table, escape_csv)) text += joined_cells(line, ",") + "\r\n";
  return text;
}

std::string escape_latex(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '\\':
        escaped += "\\textbackslash{}";
        break;
      case '~':
        escaped += "\\textasciitilde{}";
        break;
      case '^':
        escaped += "\\textasciicircum{}";
        break;
      case '&':
      case '%':
      case '$':
      case '#':
      case '_':
      case '{':
      case '}':
        escaped += '\\';
        escaped += c;
        break;
      case '\n':
      case '\r':
        escaped += ' ';
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string number_cell(double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; }

std::string latex_table(const TextTable& table) {
  const auto lines = escaped_lines(table, [](const std::string& cell) { return escape_latex(cell); });
  std::string columns;
  for (std::size_t i = 0; i < table.header.size(); ++i) columns += i < table.label_columns ? 'l' : 'r';
  std::string text =
      "\\begin{tabular}{" + columns + "}\n\\toprule\n" + joined_cells(lines.front(), " & ") + " \\\\\n\\midrule\n";
  // A bracket at the start of a row would be read as the argument of the line break before it.
  for (std::size_t i = 1; i < lines.size(); ++i) text += "{}" + joined_cells(lines[i], " & ") + " \\\\\n";
  return text + "\\bottomrule\n\\end{tabular}\n";
}

RowLabels row_labels(const std::vector<LabelColumn>& columns) {
  RowLabels labels;
  labels.cells.resize(columns.front().values.size());
  for (const LabelColumn& column : columns) {
    const std::vector<std::string>& values = column.values;
    if (!column.always && std::ranges::count(values, values.empty() ? "" : values.front()) == std::ssize(values)) {
      if (values.empty() || values.front().empty()) continue;
      std::string title = column.title;
      if (!labels.caption.empty()) title.front() += 'a' - 'A';
      labels.caption += fmt::format("{}{} {}", labels.caption.empty() ? "" : ", ", title, values.front());
      continue;
    }
    labels.columns.push_back(column.title);
    for (std::size_t i = 0; i < values.size(); ++i) labels.cells[i].push_back(values[i]);
  }
  if (!labels.caption.empty()) labels.caption += ".";
  return labels;
}

TitledTable labelled_table(const std::string& title, const RowLabels& labels) {
  return {.title = title,
          .caption = labels.caption,
          .table = {.header = labels.columns, .rows = labels.cells, .label_columns = labels.columns.size()}};
}

std::string markdown_of(const TitledTable& titled) {
  std::string text = titled.title.empty() ? "" : "### " + escape_markdown(titled.title) + "\n\n";
  if (!titled.caption.empty()) text += escape_markdown(titled.caption) + "\n\n";
  if (!titled.table.rows.empty()) text += markdown_table(titled.table);
  if (!titled.table.rows.empty() && !titled.notes.empty()) text += "\n";
  for (const std::string& note : titled.notes) text += escape_markdown(note) + "\n";
  return text;
}

std::string latex_of(const TitledTable& titled) {
  std::string text;
  if (titled.table.rows.empty()) {
    for (const std::string* line : {&titled.title, &titled.caption})
      if (!line->empty()) text += latex_comment(*line);
    for (const std::string& note : titled.notes) text += latex_comment(note);
    return text;
  }
  std::string caption = titled.title;
  if (!titled.title.empty() && !titled.caption.empty()) caption += titled.title.ends_with('.') ? " " : ". ";
  caption += titled.caption;
  text = "\\begin{table}\n\\centering\\small\n";
  if (!caption.empty()) text += fmt::format("\\caption{{{}}}\n", escape_latex(caption));
  text +=
      "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%\n" + latex_table(titled.table) + "}\n";
  for (const std::string& note : titled.notes)
    text += fmt::format("\\par\\smallskip\\parbox{{\\linewidth}}{{\\footnotesize {}}}\n", escape_latex(note));
  return text + "\\end{table}\n";
}

TitledTable with_columns(TitledTable titled, const std::vector<std::string>& columns) {
  TextTable& table = titled.table;
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < table.header.size(); ++i)
    if (i < table.label_columns || std::ranges::find(columns, table.header[i]) != columns.end()) kept.push_back(i);
  if (kept.size() == table.label_columns) return titled;
  const auto cut = [&](const std::vector<std::string>& cells) {
    std::vector<std::string> some;
    some.reserve(kept.size());
    for (const std::size_t i : kept) some.push_back(cells[i]);
    return some;
  };
  table.header = cut(table.header);
  for (std::vector<std::string>& row : table.rows) row = cut(row);
  return titled;
}

void add_column(const std::string& header, TitledTable& titled, const std::function<std::string(std::size_t)>& cell) {
  titled.table.header.push_back(header);
  for (std::size_t i = 0; i < titled.table.rows.size(); ++i) titled.table.rows[i].push_back(cell(i));
}

namespace {

// `text` formats each of the three numbers.
template <typename Text>
std::string with_interval(double value, const Interval& interval, const Text& text) {
  if (!std::isfinite(value) || !std::isfinite(interval.low)) return text(value);
  return fmt::format("{} [{}, {}]", text(value), text(interval.low), text(interval.high));
}

}  // namespace

std::string task_title(const std::string& task) {
  if (task == "all") return "Overall";
  std::string title = task;
  std::replace(title.begin(), title.end(), '_', '-');
  if (!title.empty() && title.front() >= 'a' && title.front() <= 'z') title.front() -= 'a' - 'A';
  return title;
}

std::string count_cell(long count) { return fmt::format("{}", count); }

std::string counted(long count, const char* noun) { return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s"); }

// Adding 0.0 turns -0.0 into 0.0, so that no table prints "-0.0".
std::string decimals(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value + 0.0, digits) : "-";
}

std::string decimals(double value, const Interval& interval, int digits) {
  return with_interval(value, interval, [&](double number) { return decimals(number, digits); });
}

std::string percent(double fraction) { return decimals(100.0 * fraction, 1); }

std::string percent(double fraction, const Interval& interval) {
  return with_interval(fraction, interval, [](double number) { return percent(number); });
}

std::string points(double difference, const Interval& interval) {
  if (!std::isfinite(difference)) return "-";
  const auto rounded = [](double fraction) { return std::round(1000.0 * fraction) / 10.0 + 0.0; };
  if (!std::isfinite(interval.low)) return fmt::format("{:+.1f}", rounded(difference));
  return fmt::format("{:+.1f} [{:.1f}, {:.1f}]", rounded(difference), rounded(interval.low), rounded(interval.high));
}

std::string p_cell(double p) {
  if (std::isnan(p)) return "-";
  return p < 0.001 ? "<0.001" : fmt::format("{:.3f}", p);
}

std::string p_text(double p) { return p < 0.001 ? "p < 0.001" : "p = " + p_cell(p); }

std::string significant(double value) { return std::isfinite(value) ? fmt::format("{:.4g}", value) : "-"; }

std::string short_number(double value, int most_decimals) {
  if (!std::isfinite(value)) return "-";
  const double size = std::abs(value);
  if (size >= 1e5) return fmt::format("{:.3g}", value);
  return fmt::format("{:.{}f}", value,
                     std::min(most_decimals, size >= 100.0  ? 0
                                             : size >= 10.0 ? 1
                                             : size >= 1.0  ? 2
                                                            : 3));
}

std::string short_number(double value, const Interval& interval, int most_decimals) {
  return with_interval(value, interval, [&](double number) { return short_number(number, most_decimals); });
}

}  // namespace duet
