// The one check for misuse. Files, engines and devices throw std::runtime_error instead; what an experiment may measure
// is a value (core/task.h). Thread-safe.
#pragma once

#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// Throws std::invalid_argument(message) unless `condition` holds. The message names the object, what was expected and
// what was found.
inline void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}
inline void require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

[[noreturn]] void throw_invalid(fmt::string_view format, fmt::format_args arguments);

// The same with fmt's placeholders: the message is made, out of line, only where the condition does not hold.
template <typename First, typename... Rest>
void require(bool condition, fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  if (!condition) throw_invalid(format, fmt::make_format_args(first, rest...));
}

// A file, an engine or a device that cannot do what was asked of it. The command line answers with exit code 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Something this build or this machine lacks (an engine, an asset, a device). The command line answers with exit
// code 4.
class MissingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Text that comes from a file or another program, made fit for a message. Thread-safe.

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
std::string excerpt(std::string_view text, std::size_t most = kShown);

// The same for a text of any length, such as a table: line ends and tabs stay.
std::string printable(std::string_view text);

// Messages with long names cut: a name of a file may have thousands of characters, and a message may hold it twice.
// Thread-safe.

inline constexpr std::size_t kShownName = 400;  // [bytes]; the longest name of one file has 255

// `text`, where a word, or a name in quotes that has spaces, of more than `most` bytes keeps its beginning and its end.
// For whole messages, at the place where they are written; excerpt() cuts one text that stands in a message.
std::string with_short_names(std::string_view text, std::size_t most = kShownName);

// The parts of a line of text. The returned parts point into `text`.

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

// A number that somebody typed.

// The finite number that the whole text is, in the C locale; nothing where it is none.
inline std::optional<double> parse_number(std::string_view text) {
  double value = 0.0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, value);
  if (error != std::errc() || end != last || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace duet
