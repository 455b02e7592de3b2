#include "duet/rows/json_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json numbers_or_null(const std::map<std::string, double>& values) { return json_value({}, values); }

nlohmann::json json_of(const Interval& interval) {
  return nlohmann::json::array({number_or_null(interval.low), number_or_null(interval.high)});
}

namespace {

// "'text'", "a list of 3", "a mapping", "nothing", as YAML's values are called.
std::string found_value(const nlohmann::json& json) {
  constexpr std::size_t kShownValue = 40;
  if (json.is_null()) return "nothing";
  if (json.is_string()) return fmt::format("'{}'", excerpt(json.get_ref<const std::string&>(), kShownValue));
  if (json.is_array()) return fmt::format("a list of {}", json.size());
  return json.is_object() ? "a mapping" : excerpt(dumped(json), kShownValue);
}

std::string values_of_count(const FieldRange& range, std::int64_t most) {
  if (!range.is_set()) return "a whole number of at least 0";
  return values_of_whole(range, static_cast<double>(std::numeric_limits<int>::min()), static_cast<double>(most));
}

}  // namespace

std::string JsonNode::mapping() const {
  return step_ == Step::kKey || parent_->parent_ == nullptr ? parent_->place() : parent_->mapping();
}

std::string JsonNode::path() const {
  if (parent_ == nullptr) return "";
  if (step_ == Step::kKey) return excerpt(name_);
  const std::string above = parent_->path();
  if (step_ == Step::kElement) return fmt::format("{}[{}]", above, index_);
  return fmt::format("{}{}{}", above, above.empty() ? "" : ".", excerpt(name_));
}

std::string JsonNode::place() const {
  return parent_ == nullptr ? document_ : fmt::format("{}: {}", mapping(), path());
}

void JsonNode::fail(const std::string& message) const { throw InputError(fmt::format("{}: {}", place(), message)); }

void JsonNode::refuse_key(std::string_view message) const {
  if (parent_ == nullptr) fail(std::string(message));
  throw InputError(fmt::format("{}: key '{}': {}", mapping(), path(), message));
}

void JsonNode::refuse(std::string_view expected) const {
  refuse_key(fmt::format("expected {}, found {}", expected, found_value(value_)));
}

JsonNode JsonNode::at(std::string_view key) const {
  require_mapping();
  const auto found = value_.find(key);
  if (found == value_.end()) fail(fmt::format("expected the key '{}', found none", key));
  return this->key(key, *found);
}

void JsonNode::require_list() const {
  if (!value_.is_array()) refuse("a list");
}

void JsonNode::require_mapping() const {
  if (!value_.is_object()) refuse("a mapping");
}

void JsonNode::require_keys(const std::vector<std::string>& known) const {
  for (const auto& [key, value] : value_.items())
    if (std::ranges::find(known, key) == known.end()) fail(unknown_name_message("key", key, known));
}

void require_schema(const JsonNode& document, const nlohmann::json& schema) {
  const auto shown = [](const nlohmann::json& json) {
    return excerpt(json.is_string() ? json.get<std::string>() : dumped(json));
  };
  const nlohmann::json& found = document.at("schema").value();
  if (found != schema) document.fail(fmt::format("expected schema {}, found {}", shown(schema), shown(found)));
}

nlohmann::json parse_document(std::string_view text, const std::string& what, std::string_view schema) {
  nlohmann::json json = parse_json(text, what);
  require_schema(JsonNode(json, what), schema);
  json.erase("schema");
  return json;
}

void read_value(const JsonNode& node, const FieldDoc&, std::string& value) {
  if (!node.value().is_string()) node.refuse("a text");
  value = node.value().get<std::string>();
}

void read_value(const JsonNode& node, const FieldDoc& words, double& value) {
  const nlohmann::json& json = node.value();
  const bool null_is_nan = !words.finite && !words.range.is_set();
  value = json.is_number() ? json.get<double>() : std::numeric_limits<double>::quiet_NaN();
  if (json.is_number() ? !contains(words.range, value) : !(json.is_null() && null_is_nan))
    node.refuse(null_is_nan ? "a number or null" : values_of_number(words.range, words.unit));
}

void read_value(const JsonNode& node, const FieldDoc&, bool& value) {
  if (!node.value().is_boolean()) node.refuse("true or false");
  value = node.value().get<bool>();
}

std::int64_t read_whole(const JsonNode& node, const FieldDoc& words, std::int64_t most) {
  const nlohmann::json& json = node.value();
  const FieldRange range = words.range.is_set() ? words.range : FieldRange{.low = 0.0};
  const bool is_whole = json.is_number_integer() &&
                        !(json.is_number_unsigned() && json.get<std::uint64_t>() > static_cast<std::uint64_t>(most));
  if (!is_whole || json.get<std::int64_t>() > most || !contains(range, json.get<double>()))
    node.refuse(values_of_count(words.range, most));
  return json.get<std::int64_t>();
}

std::uint64_t read_unsigned(const JsonNode& node) {
  if (!node.value().is_number_unsigned()) node.refuse("a whole number of at least 0");
  return node.value().get<std::uint64_t>();
}

std::size_t read_choice(const JsonNode& node, const FieldDoc& words) {
  std::string word;
  read_value(node, words, word);
  const auto found = std::ranges::find(words.choices, word);
  if (found == words.choices.end()) node.refuse_key(unknown_name_message(words.name, word, words.choices));
  return static_cast<std::size_t>(found - words.choices.begin());
}

std::int64_t read_any_whole(const JsonNode& node) {
  constexpr int kMost = std::numeric_limits<int>::max();
  static const FieldDoc words = {.range = {.low = std::numeric_limits<int>::min()}};
  return read_whole(node, words, kMost);
}

std::string list_type(const std::string& of) {
  return of.starts_with("list ") ? fmt::format("list of lists{}", of.substr(4)) : fmt::format("list of {}s", of);
}

}  // namespace duet
