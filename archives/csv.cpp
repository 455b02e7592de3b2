#include "duet/archives/csv.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMostFields = 4096;

// Some writers give every number its sign.
std::string_view without_plus(std::string_view field) {
  return field.size() > 1 && field.front() == '+' && field[1] != '-' && field[1] != '+' ? field.substr(1) : field;
}

// "0,5" is a half where commas do not divide fields.
std::optional<double> number_with_comma(std::string_view field) {
  const std::size_t comma = field.find(',');
  if (comma == std::string_view::npos || field.find('.') != std::string_view::npos) return std::nullopt;
  std::string point(field);
  point[comma] = '.';
  return parse_number(point);
}

bool is_one_field(std::string_view field) {
  return field.find(',') == std::string_view::npos || number_with_comma(without_plus(trimmed(field))).has_value();
}

// The line without its quoted parts, which say nothing of the delimiter.
std::string without_quoted(std::string_view line) {
  std::string bare;
  bool quoted = false;
  for (const char c : line) {
    quoted = quoted != (c == '"');
    if (!quoted) bare += c;
  }
  return bare;
}

char delimiter_of(std::string_view line) {
  const std::string bare = without_quoted(line);
  for (const char candidate : {';', '\t'}) {
    if (bare.find(candidate) == std::string::npos) continue;
    const std::vector<std::string_view> fields = split(bare, candidate);
    if (std::all_of(fields.begin(), fields.end(), is_one_field)) return candidate;
  }
  const bool blanks = trimmed(bare).find_first_of(" \t") != std::string_view::npos;
  return bare.find(',') == std::string::npos && blanks ? ' ' : ',';
}

}  // namespace

CsvReader::CsvReader(std::string_view text, std::string name)
    : text_(without_byte_order_mark(text)), name_(std::move(name)) {}

bool CsvReader::next() {
  while (at_ < text_.size()) {
    line_ = next_line_;
    const std::size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
    const std::string_view line = trimmed(text_.substr(at_, end - at_), delimiter_ == '\t' ? " " : " \t");
    const bool declares = delimiter_ == '\0' && line.size() == 5 && line.starts_with("sep=");
    if (!line.empty() && line.front() != '#' && !declares) {
      if (delimiter_ == '\0') delimiter_ = delimiter_of(line);
      read_row();
      return true;
    }
    if (declares) delimiter_ = line.back();
    if (line.starts_with('#')) comments_.push_back(line);
    at_ = end;
    take_line_end();
  }
  return false;
}

bool CsvReader::blank() const {
  const auto row = fields();
  return std::all_of(row.begin(), row.end(), [](const std::string& field) { return field.empty(); });
}

std::optional<double> CsvReader::number(std::string_view field) const {
  field = without_plus(field);
  if (const std::optional<double> value = parse_number(field)) return value;
  return delimiter_ == ',' ? std::nullopt : number_with_comma(field);
}

void CsvReader::fail(const std::string& fault) const {
  const std::string place = line_ == 0 ? "" : fmt::format("line {}: ", line_);
  throw InputError(fmt::format("'{}': {}{}", excerpt(name_, kShownSentence), place, fault));
}

void CsvReader::read_row() {
  count_ = 0;
  for (bool more = true; more;) {
    if (count_ == kMostFields) fail(fmt::format("expected at most {} columns, found more", kMostFields));
    if (count_ == fields_.size()) fields_.emplace_back();
    more = read_field(fields_[count_++]);
  }
  cut_empty_ends();
}

// A spreadsheet fills lines up to its longest; the first row with something in it tells how many columns there are.
void CsvReader::cut_empty_ends() {
  if (width_ == 0 && blank()) return;
  while (count_ > std::max<std::size_t>(width_, 1) && fields_[count_ - 1].empty()) --count_;
  if (width_ == 0) width_ = count_;
}

bool CsvReader::read_field(std::string& field) {
  field.clear();
  while (at_ < text_.size() && (text_[at_] == ' ' || (text_[at_] == '\t' && delimiter_ != '\t'))) ++at_;
  if (at_ < text_.size() && text_[at_] == '"') read_quoted(field);
  std::size_t end = at_;
  while (end < text_.size() && text_[end] != delimiter_ && text_[end] != '\n' && text_[end] != '\r') ++end;
  field += trimmed(text_.substr(at_, end - at_));
  at_ = end;
  if (at_ < text_.size() && text_[at_] == delimiter_) {
    ++at_;
    return true;
  }
  take_line_end();
  return false;
}

void CsvReader::read_quoted(std::string& field) {
  for (;;) {
    const std::size_t end = text_.find('"', at_ + 1);
    if (end == std::string_view::npos) fail("a quote that begins in this row is not closed");
    const std::string_view part = text_.substr(at_ + 1, end - at_ - 1);
    next_line_ += static_cast<int>(std::count(part.begin(), part.end(), '\n'));
    field += part;
    at_ = end + 1;
    if (at_ >= text_.size() || text_[at_] != '"') break;
    field += '"';
  }
  const std::string inside(trimmed(field));
  field = inside;
}

void require_header(CsvReader& rows, std::span<const std::string> names) {
  if (!rows.next()) rows.fail(fmt::format("expected the header '{}', found nothing", fmt::join(names, ",")));
  const auto found = rows.fields();
  if (!std::equal(found.begin(), found.end(), names.begin(), names.end()))
    rows.fail(fmt::format("expected the header '{}', found '{}'", fmt::join(names, ","),
                          excerpt(fmt::format("{}", fmt::join(found, ",")))));
}

void CsvReader::take_line_end() {
  if (at_ >= text_.size()) return;
  at_ += text_.substr(at_).starts_with("\r\n") ? 2 : 1;
  ++next_line_;
}

}  // namespace duet
