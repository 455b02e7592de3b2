// Text that comes from a file or another program, made fit for a message. Thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace duet {

struct CodePoint {
  char32_t code = 0;
  std::size_t length = 1;  // [bytes]
};

// The code point that begins at byte `at` of UTF-8 text; nothing where these bytes are not UTF-8.
std::optional<CodePoint> code_point_at(std::string_view text, std::size_t at);

inline constexpr std::size_t kShown = 80;            // about one line of a terminal
inline constexpr std::size_t kShownSentence = 2000;  // a sentence that lists the known names

// `text`, where longer cut to `most` bytes with "..." last. Escapes all that could move a terminal's cursor, recolour
// it or turn its text around: "\x1b" for a control character or a byte that is not UTF-8, "\n", "\t", "\u202e".
std::string shown(std::string_view text, std::size_t most = kShown);

// The same for a text of any length, such as a table: line ends and tabs stay.
std::string printable(std::string_view text);

}  // namespace duet
