#include "duet/core/synthetic_id.h"

#include <fmt/format.h>

#include <algorithm>

namespace duet {
namespace {

// Takes what stands before the next hyphen, or all of it.
std::string_view next_word(std::string_view& rest) {
  const std::size_t hyphen = rest.find('-');
  const std::string_view word = rest.substr(0, hyphen);
  rest.remove_prefix(hyphen == std::string_view::npos ? rest.size() : hyphen + 1);
  return word;
}

bool is_number(std::string_view word) {
  return !word.empty() && std::ranges::all_of(word, [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index) {
  return fmt::format("{}-{}-s{}-{:04}", manner, task, seed, index);
}

bool is_synthetic_clip(std::string_view id) {
  const std::string_view manner = next_word(id), task = next_word(id), seed = next_word(id), index = next_word(id);
  return (manner == "synth" || manner == "people") && !task.empty() && seed.starts_with('s') &&
         is_number(seed.substr(1)) && is_number(index);
}

}  // namespace duet
