#include "duet/core/names.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <numeric>
#include <ranges>
#include <stdexcept>
#include <utility>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kAtAGlance = 24, kNearest = 5;

std::string folded(std::string_view name) {
  std::string text(name);
  for (char& c : text) c = c == '-' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// Damerau-Levenshtein distance (optimal string alignment: no part is edited twice).
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), previous(b.size() + 1), current(b.size() + 1);
  std::iota(previous.begin(), previous.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = previous[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      current[j] = std::min({previous[j] + 1, current[j - 1] + 1, replaced});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) current[j] = std::min(current[j], before[j - 2] + 1);
    }
    std::swap(before, previous);
    std::swap(previous, current);
  }
  return previous[b.size()];
}

// The candidates in the order of their distance to the name, those of one distance as they were given.
std::vector<std::string> by_distance(std::string_view name, std::span<const std::string> candidates) {
  const std::string wanted = folded(name);
  std::vector<std::pair<std::size_t, std::string>> ranked;
  for (const std::string& candidate : candidates)
    ranked.emplace_back(edit_distance(wanted, folded(candidate)), candidate);
  std::ranges::stable_sort(ranked, {}, &std::pair<std::size_t, std::string>::first);
  std::vector<std::string> names;
  names.reserve(ranked.size());
  for (auto& [distance, candidate] : ranked) names.push_back(std::move(candidate));
  return names;
}

// All of a list that a person can read at a glance, the nearest ones of a longer one.
std::string known_names(std::string_view name, std::span<const std::string> candidates) {
  if (candidates.empty()) return "Known: none";
  if (candidates.size() <= kAtAGlance) return fmt::format("Known: {}", fmt::join(candidates, ", "));
  std::vector<std::string> nearest = by_distance(name, candidates);
  nearest.resize(kNearest);
  return fmt::format("Nearest of {}: {}", candidates.size(), fmt::join(nearest, ", "));
}

}  // namespace

std::string closest_name(std::string_view name, std::span<const std::string> candidates) {
  const std::string wanted = folded(name);
  std::size_t best = std::max<std::size_t>(2, wanted.size() / 3) + 1;
  std::string closest;
  for (const std::string& candidate : candidates) {
    // A distance of the whole length means that nothing is shared: no help to anyone.
    const std::size_t distance = edit_distance(wanted, folded(candidate));
    if (distance >= best || distance >= std::max(wanted.size(), candidate.size())) continue;
    best = distance;
    closest = candidate;
  }
  return closest;
}

std::string unknown_name_message(std::string_view kind, std::string_view name,
                                 std::span<const std::string> candidates) {
  const std::string closest = closest_name(name, candidates);
  const std::string question = closest.empty() ? "." : fmt::format(": did you mean '{}'?", closest);
  return fmt::format("unknown {} '{}'{} {}", kind, excerpt(name), question, known_names(name, candidates));
}

std::string option_or(const std::map<std::string, std::string>& options, const std::string& name,
                      const std::string& fallback) {
  const auto found = options.find(name);
  return found == options.end() ? fallback : found->second;
}

void check_options(std::string_view kind, std::string_view name, const std::map<std::string, std::string>& options,
                   std::span<const std::string> known) {
  for (const auto& [option, value] : options) {
    if (known.empty())
      throw std::invalid_argument(fmt::format("{} '{}': expected no option, found '{}'", kind, name, option));
    if (std::find(known.begin(), known.end(), option) == known.end())
      throw std::invalid_argument(
          fmt::format("{} '{}': {}", kind, name, unknown_name_message("option", option, known)));
  }
}

bool is_plain_letter(char letter) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.+-";
  return kLetters.find(letter) != std::string_view::npos;
}

bool is_plain_name(std::string_view name) {
  return !name.empty() && name.front() != '+' && name.front() != '-' && std::ranges::all_of(name, is_plain_letter);
}

std::string plain_name_message(std::string_view name) {
  return fmt::format("expected letters, digits and _ . + - only, none of + and - first, found '{}'", name);
}

std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index) {
  return fmt::format("{}-{}-s{}-{:04}", manner, task, seed, index);
}

std::string tracked_clip_id(const std::string& id) { return id + "-tracked"; }

std::string id_in_other_role(const std::string& id, char before) {
  const std::string own = before == 'A' ? "-A" : "-B", other = before == 'A' ? "-B" : "-A";
  return id.size() > own.size() && id.ends_with(own) ? id.substr(0, id.size() - own.size()) : id + other;
}

std::string shell_word(std::string_view text) {
  constexpr std::string_view kPlain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_./:=,+-@%";
  if (!text.empty() && text.find_first_not_of(kPlain) == std::string_view::npos) return std::string(text);
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

std::string shell_words(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line.append(line.empty() ? "" : " ").append(shell_word(word));
  return line;
}

}  // namespace duet
