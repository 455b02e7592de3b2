// The parts of a line of text. The returned parts point into `text`.
#pragma once

#include <string_view>
#include <vector>

namespace duet {

// The text without those of the marks that stand at its ends.
inline std::string_view trimmed(std::string_view text, std::string_view marks = " \t\r") {
  const std::size_t begin = text.find_first_not_of(marks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(marks) - begin + 1);
}

// The parts before, between and after the marks: one part more than there are marks, empty ones included.
inline std::vector<std::string_view> split(std::string_view text, char mark) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t end = text.find(mark);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

}  // namespace duet
