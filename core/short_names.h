// Messages with long names cut: a name of a file may have thousands of characters, and a message may hold it twice.
// Thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace duet {

inline constexpr std::size_t kShownName = 400;  // [bytes]; the longest name of one file has 255

// `text`, where a word, or a name in quotes that has spaces, of more than `most` bytes keeps its beginning and its end.
// For whole messages, at the place where they are written; shown() cuts one text that stands in a message.
std::string with_short_names(std::string_view text, std::size_t most = kShownName);

}  // namespace duet
