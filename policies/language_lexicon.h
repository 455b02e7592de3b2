// What the built-in language encoder knows of English: phrases and what they mean, words that say little, and the
// commands of the tasks. Plain data.
#pragma once

#include <span>
#include <string_view>

namespace duet {

// A phrase of one to three words as people write them; the encoder compares stems and leaves function words out.
struct LexiconEntry {
  std::string_view phrase;
  std::string_view concept_name;
  double weight;  // 1: says it outright; less: a hint that a plainer phrase overrules
};

std::span<const LexiconEntry> language_lexicon();
std::span<const std::string_view> function_words();

}  // namespace duet
