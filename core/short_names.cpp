#include "duet/core/short_names.h"

#include <algorithm>

namespace duet {
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
