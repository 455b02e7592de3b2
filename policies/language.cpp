// The built-in encoder and tables of embeddings. The built-in one uses no function of the maths library but the square
// root, so that its bits do not depend on the machine.
#include "duet/policies/language.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "duet/archives/npy/npz.h"
#include "duet/core/names.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

using Words = std::vector<std::string>;
using Weights = std::map<std::string, double>;

constexpr double kConceptWeight = 1.0, kWordWeight = 0.25, kFunctionWordWeight = 0.04, kNgramWeight = 0.06;
constexpr std::size_t kLongestPhrase = 3;  // words

bool is_upper(char c) { return c >= 'A' && c <= 'Z'; }
// Bytes of other scripts are letters: nothing is known of their case.
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || is_upper(c) || (c >= '0' && c <= '9') || static_cast<unsigned char>(c) >= 0x80;
}

// "Let's High-five!" -> "lets", "high", "five".
Words split_words(std::string_view text) {
  Words words(1);
  for (const char c : text) {
    if (c == '\'') continue;
    if (is_letter(c))
      words.back() += is_upper(c) ? static_cast<char>(c - 'A' + 'a') : c;
    else if (!words.back().empty())
      words.emplace_back();
  }
  if (words.back().empty()) words.pop_back();
  return words;
}

bool strip(std::string& word, std::string_view suffix, std::size_t shortest) {
  if (word.size() < shortest || !word.ends_with(suffix)) return false;
  word.resize(word.size() - suffix.size());
  return true;
}

// "hugging" -> "hugg" -> "hug"; "kiss" stays.
void undouble(std::string& word) {
  const std::size_t n = word.size();
  constexpr std::string_view kStays = "aeiouslz";
  if (n > 2 && word[n - 1] == word[n - 2] && kStays.find(word[n - 1]) == std::string_view::npos) word.pop_back();
}

std::string stem(std::string word) {
  if (strip(word, "ing", 6) || strip(word, "ed", 5))
    undouble(word);
  else if (!strip(word, "es", 5) && !word.ends_with("ss"))
    strip(word, "s", 4);
  strip(word, "e", 4);
  return word;
}

std::string joined(std::span<const std::string> words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

void keep_largest(Weights& weights, const std::string& key, double weight) {
  double& kept = weights[key];
  kept = std::max(kept, weight);
}

class BuiltInLanguage final : public LanguageEncoder {
 public:
  BuiltInLanguage() {
    for (const std::string_view word : function_words()) function_words_.insert(stem(std::string(word)));
    for (const Task task : all_tasks()) add_phrases(definition_of(task));
  }
  [[nodiscard]] std::string_view name() const override { return kBuiltInLanguage; }
  [[nodiscard]] int size() const override { return kLanguageSize; }

  [[nodiscard]] std::vector<float> embed(std::string_view prompt) const override {
    const Weights weights = weights_of(prompt);
    require(!weights.empty(), "language: expected a prompt with a word, found '{}'", prompt);
    std::vector<double> sum(kLanguageSize, 0.0);
    for (const auto& [key, weight] : weights) add_direction(key, weight, sum);
    double square = 0.0;
    for (const double x : sum) square += x * x;
    std::vector<float> embedding;
    embedding.reserve(sum.size());
    for (const double x : sum) embedding.push_back(static_cast<float>(x / std::sqrt(square)));
    return embedding;
  }

 private:
  using Meaning = std::pair<std::string, double>;

  void add_phrases(const TaskDefinition& task) {
    for (const TaskPhrase& entry : task.phrases) {
      Words stems = split_words(entry.phrase);
      for (std::string& word : stems) word = stem(std::move(word));
      lexicon_[joined(stems)] = {std::string(task.name), entry.weight};
    }
  }

  // The parts of the text -> how much each counts; each part once, however often it is said.
  [[nodiscard]] Weights weights_of(std::string_view prompt) const {
    Weights weights;
    Words content;
    for (std::string& word : split_words(prompt)) {
      word = stem(std::move(word));
      const bool says_little = function_words_.contains(word);
      keep_largest(weights, "word " + word, says_little ? kFunctionWordWeight : kWordWeight);
      if (says_little) continue;
      add_ngrams(word, weights);
      content.push_back(std::move(word));
    }
    add_concepts(content, weights);
    return weights;
  }

  static void add_ngrams(const std::string& word, Weights& weights) {
    const std::string padded = "^" + word + "$";
    for (std::size_t i = 0; i + 3 <= padded.size(); ++i) weights["ngram " + padded.substr(i, 3)] = kNgramWeight;
  }

  // The longest phrase that starts at each word; its words are then spent.
  void add_concepts(std::span<const std::string> content, Weights& weights) const {
    for (std::size_t i = 0; i < content.size();) {
      const auto [meaning, used] = longest_phrase(content.subspan(i));
      if (meaning != nullptr) keep_largest(weights, "concept " + meaning->first, kConceptWeight * meaning->second);
      i += used;
    }
  }

  [[nodiscard]] std::pair<const Meaning*, std::size_t> longest_phrase(std::span<const std::string> words) const {
    for (std::size_t n = std::min(kLongestPhrase, words.size()); n > 0; --n)
      if (const auto found = lexicon_.find(joined(words.first(n))); found != lexicon_.end()) return {&found->second, n};
    return {nullptr, 1};
  }

  // A direction of unit expected length that belongs to the key alone.
  static void add_direction(const std::string& key, double weight, std::vector<double>& sum) {
    Random random(0, stream_key({kBuiltInLanguage, key}));
    const double scale = weight * std::sqrt(3.0 / kLanguageSize);  // uniform in [-1, 1): variance 1/3
    for (double& x : sum) x += scale * random.uniform(-1.0, 1.0);
  }

  std::map<std::string, Meaning> lexicon_;
  std::set<std::string> function_words_;
};

class LanguageTable final : public LanguageEncoder {
 public:
  explicit LanguageTable(const std::string& path) : path_(path) {
    if (!std::filesystem::exists(path)) throw MissingError(fmt::format("language table {}: file not found", path));
    const Npz archive = Npz::load(path);
    name_ = archive.text("name");
    prompts_ = archive.strings("prompts", {-1});
    const auto count = static_cast<long>(prompts_.size());
    const std::vector<double> values = archive.numbers("embeddings", {count, -1});
    size_ = prompts_.empty() ? 0 : static_cast<int>(values.size() / prompts_.size());
    if (size_ == 0) throw InputError(fmt::format("{}: embeddings: expected at least one prompt and number", path));
    for (std::size_t i = 0; i < prompts_.size(); ++i)
      add_row(prompts_[i], std::span(values).subspan(i * static_cast<std::size_t>(size_)).first(row_size()));
  }
  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] int size() const override { return size_; }
  [[nodiscard]] std::vector<float> embed(std::string_view prompt) const override {
    const Words words = split_words(prompt);
    require(!words.empty(), "language: expected a prompt with a word, found '{}'", prompt);
    const auto found = rows_.find(joined(words));
    require(found != rows_.end(), "language table {}: {}", path_, unknown_name_message("prompt", prompt, prompts_));
    return found->second;
  }

 private:
  [[nodiscard]] std::size_t row_size() const { return static_cast<std::size_t>(size_); }

  void add_row(const std::string& prompt, std::span<const double> row) {
    double square = 0.0;
    for (const double x : row) square += x * x;
    const auto refuse = [&](const char* expected) {
      return InputError(fmt::format("{}: prompt '{}': expected {}", path_, prompt, expected));
    };
    if (!(square > 0.0)) throw refuse("an embedding other than zero, found all zeros");
    std::vector<float> unit;
    unit.reserve(row.size());
    for (const double x : row) unit.push_back(static_cast<float>(x / std::sqrt(square)));
    const std::string key = joined(split_words(prompt));
    if (key.empty()) throw refuse("a word, found none");
    if (!rows_.emplace(key, std::move(unit)).second) throw refuse("each prompt once, found it again");
  }

  std::string path_, name_;
  int size_ = 0;
  std::vector<std::string> prompts_;
  std::map<std::string, std::vector<float>> rows_;  // by the words in lower case
};

}  // namespace

std::string_view task_prompt(Task task) { return definition_of(task).prompt; }
std::span<const std::string_view> task_paraphrases(Task task) { return definition_of(task).paraphrases; }
std::string leading_prompt(std::string_view prompt) { return fmt::format("{} first", prompt); }
bool is_leading(std::string_view prompt) { return prompt.ends_with(" first"); }

std::unique_ptr<LanguageEncoder> built_in_language() { return std::make_unique<BuiltInLanguage>(); }

std::unique_ptr<LanguageEncoder> load_language_table(const std::string& path) {
  return std::make_unique<LanguageTable>(path);
}

double cosine(const std::vector<float>& a, const std::vector<float>& b) {
  require(a.size() == b.size(), "cosine: expected vectors of one size, found {} and {}", a.size(), b.size());
  double ab = 0.0, aa = 0.0, bb = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += static_cast<double>(a[i]) * b[i];
    aa += static_cast<double>(a[i]) * a[i];
    bb += static_cast<double>(b[i]) * b[i];
  }
  return aa > 0.0 && bb > 0.0 ? ab / std::sqrt(aa * bb) : 0.0;
}

namespace {

constexpr std::string_view kFunctionWords[] = {
    "a",    "an",  "and", "are",  "as",   "at",   "be",    "by",     "can",  "do",    "for",    "from",   "give",
    "go",   "he",  "her", "him",  "his",  "i",    "in",    "into",   "is",   "it",    "its",    "let",    "lets",
    "make", "me",  "my",  "now",  "of",   "off",  "on",    "one",    "or",   "other", "out",    "person", "please",
    "our",  "she", "so",  "some", "that", "the",  "their", "them",   "then", "they",  "this",   "to",     "towards",
    "up",   "us",  "we",  "with", "you",  "your", "human", "people", "big",  "very",  "partner"};

}  // namespace

std::span<const std::string_view> function_words() { return kFunctionWords; }

}  // namespace duet
