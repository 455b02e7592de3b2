// Language commands as vectors (A.2.4: 768 numbers per prompt). Built in: a deterministic text embedding that needs no
// download; a user's own encoder comes as a table of prompts and embeddings.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"

namespace duet {

inline constexpr int kLanguageSize = 768;
inline constexpr std::string_view kBuiltInLanguage = "duet-text-1";

class LanguageEncoder {
 public:
  virtual ~LanguageEncoder() = default;
  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual int size() const = 0;
  // Unit length. Throws std::invalid_argument for a prompt without a word, or one that a table lacks (with the
  // nearest).
  [[nodiscard]] virtual std::vector<float> embed(std::string_view prompt) const = 0;
};

// Words -> concepts (a small lexicon of synonyms and stems) and character n-grams -> seeded random directions, summed
// with weights. The same text gives the same bits everywhere.
std::unique_ptr<LanguageEncoder> built_in_language();

// NPZ with `prompts` (text, N) and `embeddings` (N, size) and `name`. Throws InputError (file, key, expected, found).
std::unique_ptr<LanguageEncoder> load_language_table(const std::string& path);

// The command that stands for a task where no other is given ("shake hands with the person"), and paraphrases of it
// that training uses and that measure the built-in encoder.
std::string_view task_prompt(Task task);
std::span<const std::string_view> task_paraphrases(Task task);
// The command to begin, for a partner who will not: "wave to the person first".
std::string leading_prompt(std::string_view prompt);
bool is_leading(std::string_view prompt);

double cosine(const std::vector<float>& a, const std::vector<float>& b);

// English words that say little: the built-in language encoder leaves them out of phrases. The tasks' definitions say
// which words mean tasks (tasks/task_definition.h).
std::span<const std::string_view> function_words();

}  // namespace duet
