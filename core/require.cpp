#include "duet/core/require.h"

#include <fmt/format.h>

#include <algorithm>

namespace duet {

void throw_invalid(fmt::string_view format, fmt::format_args arguments) {
  throw std::invalid_argument(fmt::vformat(format, arguments));
}

namespace {

bool turns_text(char32_t code) {
  return (code >= 0x200e && code <= 0x200f) || (code >= 0x2028 && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
}

bool is_control(char32_t code) { return code < 0x20 || (code >= 0x7f && code < 0xa0); }

std::string escaped(std::string_view bytes, std::optional<CodePoint> point) {
  if (!point) return fmt::format("\\x{:02x}", static_cast<unsigned char>(bytes.front()));
  if (point->code == U'\n') return "\\n";
  if (point->code == U'\t') return "\\t";
  if (is_control(point->code)) return fmt::format("\\x{:02x}", static_cast<unsigned>(point->code));
  if (turns_text(point->code)) return fmt::format("\\u{:04x}", static_cast<unsigned>(point->code));
  return std::string(bytes);
}

}  // namespace

std::optional<CodePoint> code_point_at(std::string_view text, std::size_t at) {
  const auto lead = static_cast<unsigned char>(text[at]);
  if (lead < 0x80) return CodePoint{lead, 1};
  const std::size_t length = lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
  if (lead < 0xc2 || lead > 0xf4 || length > text.size() - at) return std::nullopt;
  char32_t code = lead & (0xffU >> (length + 1));
  for (std::size_t k = 1; k < length; ++k) {
    const auto next = static_cast<unsigned char>(text[at + k]);
    if ((next & 0xc0) != 0x80) return std::nullopt;
    code = (code << 6) | (next & 0x3f);
  }
  const char32_t smallest = length == 4 ? 0x10000 : length == 3 ? 0x800 : 0x80;  // shorter forms exist below it
  if (code < smallest || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) return std::nullopt;
  return CodePoint{code, length};
}

std::string excerpt(std::string_view text, std::size_t most) {
  std::string result;
  std::size_t kept = 0;  // bytes of `result` that leave room for the dots
  for (std::size_t at = 0; at < text.size();) {
    const std::optional<CodePoint> point = code_point_at(text, at);
    const std::size_t length = point ? point->length : 1;
    result += escaped(text.substr(at, length), point);
    if (result.size() > most) return result.substr(0, kept) + "...";
    if (result.size() + 3 <= most) kept = result.size();
    at += length;
  }
  return result;
}

std::string printable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t at = 0; at < text.size();) {
    const std::optional<CodePoint> point = code_point_at(text, at);
    const std::string_view bytes = text.substr(at, point ? point->length : 1);
    const bool is_layout = bytes == "\n" || bytes == "\t";
    result += is_layout ? std::string(bytes) : escaped(bytes, point);
    at += bytes.size();
  }
  return result;
}

namespace {

constexpr std::string_view kBeforeName = " ([\n", kBehindName = " ,.:;!?)]\n";

// A name in quotes ends behind its last quote, which a space or a mark follows; another at the next space.
std::size_t end_of_name(std::string_view text, std::size_t at) {
  const bool quoted = text[at] == '\'' && (at == 0 || kBeforeName.find(text[at - 1]) != std::string_view::npos);
  for (std::size_t end = quoted ? text.find('\'', at + 1) : std::string_view::npos; end != std::string_view::npos;
       end = text.find('\'', end + 1))
    if (end + 1 == text.size() || kBehindName.find(text[end + 1]) != std::string_view::npos) return end + 1;
  return std::max(at + 1, std::min(text.find_first_of(" \n", at), text.size()));
}

// The beginning of the code point that byte `at` belongs to.
std::size_t begin_of_point(std::string_view text, std::size_t at) {
  while (at > 0 && (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80) --at;
  return at;
}

}  // namespace

std::string with_short_names(std::string_view text, std::size_t most) {
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = end_of_name(text, at);
    const std::string_view name = text.substr(at, end - at);
    if (name.size() <= most) {
      result += name;
    } else {
      result += name.substr(0, begin_of_point(name, most / 2));
      result += "...";
      result += name.substr(begin_of_point(name, name.size() - most / 2));
    }
    at = end;
  }
  return result;
}

}  // namespace duet
