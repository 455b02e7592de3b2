#include "duet/rows/row_identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "duet/rows/json_fields.h"

namespace duet {
namespace {

using Differences = std::vector<FieldDifference>;

constexpr std::size_t kLongestValue = 80;  // characters
constexpr std::size_t kMostNamed = 5;      // fields

std::string shown_field(const nlohmann::json* value) {
  if (value == nullptr) return "nothing";
  const std::string text = dumped(*value);
  return text.size() <= kLongestValue ? text : text.substr(0, kLongestValue) + "...";
}

bool is_list_of_objects(const nlohmann::json& json) { return json.is_array() && !json.empty() && json[0].is_object(); }

void compare(const std::string& field, const nlohmann::json* first, const nlohmann::json* second, Differences& found);

void compare_members(const std::string& field, const nlohmann::json& first, const nlohmann::json& second,
                     Differences& found) {
  std::set<std::string> names;
  for (const nlohmann::json* json : {&first, &second})
    for (const auto& [name, value] : json->items()) names.insert(name);
  const auto member = [](const nlohmann::json& json, const std::string& name) {
    const auto at = json.find(name);
    return at == json.end() ? nullptr : &*at;
  };
  for (const std::string& name : names)
    compare(field.empty() ? name : fmt::format("{}.{}", field, name), member(first, name), member(second, name), found);
}

void compare_items(const std::string& field, const nlohmann::json& first, const nlohmann::json& second,
                   Differences& found) {
  const auto item = [](const nlohmann::json& json, std::size_t i) { return i < json.size() ? &json[i] : nullptr; };
  for (std::size_t i = 0; i < std::max(first.size(), second.size()); ++i)
    compare(fmt::format("{}.{}", field, i), item(first, i), item(second, i), found);
}

void compare(const std::string& field, const nlohmann::json* first, const nlohmann::json* second, Differences& found) {
  if (first != nullptr && second != nullptr) {
    if (*first == *second) return;
    if (first->is_object() && second->is_object()) return compare_members(field, *first, *second, found);
    if (is_list_of_objects(*first) && is_list_of_objects(*second)) return compare_items(field, *first, *second, found);
    if (dumped(*first) == dumped(*second)) return;
  }
  found.push_back({field, shown_field(first), shown_field(second)});
}

nlohmann::json repeatable(EpisodeRow row, bool with_tags) {
  if (!with_tags) row.tags = {};
  nlohmann::json json = to_json(row);
  for (const RowField& field : row_fields())
    if (!field.use.repeats) json.erase(std::string(field.json.name));
  return json;
}

}  // namespace

bool has_ended(Outcome outcome) { return outcome != Outcome::kError && outcome != Outcome::kTimedOut; }

Stands which_stands(Outcome first, Outcome second) {
  constexpr int kRan = 3;
  const auto weight = [](Outcome outcome) {
    if (outcome == Outcome::kError) return 0;
    if (outcome == Outcome::kTimedOut) return 1;
    return outcome == Outcome::kUnsupported ? 2 : kRan;
  };
  if (weight(first) != weight(second)) return weight(first) > weight(second) ? Stands::kFirst : Stands::kSecond;
  return weight(first) == kRan ? Stands::kBothAgreed : Stands::kEither;
}

void note_outcome(const std::string& key, Outcome outcome, std::map<std::string, Outcome>& outcomes) {
  const auto [known, is_new] = outcomes.try_emplace(key, outcome);
  if (!is_new && which_stands(known->second, outcome) == Stands::kSecond) known->second = outcome;
}

std::vector<FieldDifference> row_differences(const EpisodeRow& first, const EpisodeRow& second) {
  const bool tagged = !first.tags.empty() && !second.tags.empty();
  const nlohmann::json left = repeatable(first, tagged), right = repeatable(second, tagged);
  Differences found;
  compare("", &left, &right, found);
  return found;
}

std::vector<std::string> differing_fields(const EpisodeRow& first, const EpisodeRow& second) {
  std::vector<std::string> names;
  for (const FieldDifference& difference : row_differences(first, second)) names.push_back(difference.field);
  return names;
}

std::string differences_text(std::vector<FieldDifference> differences) {
  std::stable_partition(differences.begin(), differences.end(), [](const FieldDifference& difference) {
    return difference.field.find('.') == std::string::npos;  // "state_hash" before a hundred metrics
  });
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < std::min(differences.size(), kMostNamed); ++i)
    texts.push_back(fmt::format("{}: {}, {}", differences[i].field, differences[i].first, differences[i].second));
  if (differences.size() > kMostNamed) texts.push_back(fmt::format("{} more", differences.size() - kMostNamed));
  return fmt::format("{}", fmt::join(texts, "; "));
}

}  // namespace duet
