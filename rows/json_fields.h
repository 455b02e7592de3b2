// JSON of structs with a table of keys: the words of core/field.h, with which each key is written, read strictly and
// described. Columns of results.sqlite and docs/reference/row-fields.md are made from the same tables. Thread-safe.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "duet/core/field.h"
#include "duet/core/json.h"
#include "duet/core/named_values.h"
#include "duet/statistics/statistics.h"

namespace duet {

// null for a number that is not finite: JSON has no NaN.
nlohmann::json number_or_null(double value);
nlohmann::json numbers_or_null(const std::map<std::string, double>& values);  // an object, likewise
nlohmann::json json_of(const Interval& interval);                             // [low, high]

// A value of a JSON document and its place. Refers to the value and to the node that it was taken from. Each fault is
// an InputError: "run.json: plan: key 'parts[0]': expected WHAT, found VALUE".
class JsonNode {
 public:
  JsonNode(const nlohmann::json& value, std::string document) : value_(value), document_(std::move(document)) {}

  [[nodiscard]] const nlohmann::json& value() const { return value_; }
  [[nodiscard]] std::string place() const;  // "run.json: plan: parts[0]"
  // The value under a key of a mapping; throws where the key is absent.
  [[nodiscard]] JsonNode at(std::string_view key) const;
  // The value under a key that the mapping has, and the element of a list that has it.
  [[nodiscard]] JsonNode key(std::string_view name, const nlohmann::json& value) const {
    return {value, this, Step::kKey, name, 0};
  }
  [[nodiscard]] JsonNode element(std::size_t index) const { return {value_[index], this, Step::kElement, "", index}; }
  // The value under a name of a mapping whose names are no keys: metrics, digests.
  [[nodiscard]] JsonNode entry(std::string_view name, const nlohmann::json& value) const {
    return {value, this, Step::kEntry, name, 0};
  }

  // Throw where it is none.
  void require_list() const;
  void require_mapping() const;
  // Throws for a key of the mapping that is not `known`, with the nearest one.
  void require_keys(const std::vector<std::string>& known) const;

  [[noreturn]] void fail(const std::string& message) const;      // "PLACE: MESSAGE"
  [[noreturn]] void refuse(std::string_view expected) const;     // "PLACE: key 'KEY': expected WHAT, found VALUE"
  [[noreturn]] void refuse_key(std::string_view message) const;  // "PLACE: key 'KEY': MESSAGE"

 private:
  enum class Step { kKey, kElement, kEntry };
  JsonNode(const nlohmann::json& value, const JsonNode* parent, Step step, std::string_view name, std::size_t index)
      : value_(value), parent_(parent), step_(step), name_(name), index_(index) {}

  [[nodiscard]] std::string mapping() const;  // place of the mapping that the key is in: "run.json: plan"
  [[nodiscard]] std::string path() const;     // "parts[0]"

  const nlohmann::json& value_;
  std::string document_;  // of the root
  const JsonNode* parent_ = nullptr;
  Step step_ = Step::kKey;
  std::string_view name_;
  std::size_t index_ = 0;
};

// The description of a key: its words, the type in words ("integer", "name: number") and, of a mapping, its keys.
struct JsonDoc : FieldDoc {
  std::string type;
  std::string column;            // as SQL declares one of it; "" for lists and mappings
  std::vector<JsonDoc> members;  // of the mapping, or of each in a list of them
};

// A key of an Owner's JSON: made from its words and from the member that it fills, a pointer or a function that returns
// a reference. Text, true and false, numbers, enumerations by the words' choices, structs with a json_schema, and
// optional ones (null), lists and mappings by name of these.
template <typename Owner>
struct JsonKey : JsonDoc {
  template <typename Member>
  JsonKey(FieldDoc words, Member member);
  JsonKey(FieldDoc words, std::string of_type, std::function<nlohmann::json(const Owner&)> writer,
          std::function<void(const JsonNode&, Owner&)> reader)
      : JsonDoc{std::move(words), std::move(of_type), "", {}}, write(std::move(writer)), read(std::move(reader)) {}

  std::function<nlohmann::json(const Owner&)> write;
  std::function<void(const JsonNode&, Owner&)> read;
};

template <typename Owner>
using JsonSchema = std::vector<JsonKey<Owner>>;

// The keys of a struct that is one JSON object; each such struct specialises it.
template <typename Owner>
const JsonSchema<Owner>& json_schema() = delete;

template <typename T>
concept JsonMapping = requires {
  json_schema<T>();
};

template <typename Owner>
nlohmann::json json_mapping(const Owner& owner, const JsonSchema<Owner>& schema) {
  nlohmann::json json = nlohmann::json::object();
  for (const JsonKey<Owner>& key : schema)
    if (nlohmann::json value = key.write(owner); !key.optional || !value.empty()) json[key.name] = std::move(value);
  return json;
}
template <JsonMapping Owner>
nlohmann::json json_mapping(const Owner& owner) {
  return json_mapping(owner, json_schema<Owner>());
}

// `table`: a schema, or another list of what is a key of the Owner. `other`: a key beside it that the caller reads.
template <typename Owner, typename Table>
void read_mapping(const JsonNode& node, const Table& table, Owner& owner, const char* other = nullptr) {
  node.require_mapping();
  std::size_t known = other != nullptr && node.value().contains(other) ? 1 : 0;
  const auto refuse_unknown = [&] {
    std::vector<std::string> names = field_names(table);
    if (other != nullptr) names.emplace_back(other);
    node.require_keys(names);
  };
  for (const JsonKey<Owner>& key : table) {
    if (const auto found = node.value().find(key.name); found != node.value().end()) {
      key.read(node.key(key.name, *found), owner);
      ++known;
    } else if (!key.optional) {
      refuse_unknown();
      static_cast<void>(node.at(key.name));  // throws
    }
  }
  if (known != node.value().size()) refuse_unknown();
}
template <JsonMapping Owner>
Owner read_mapping(const JsonNode& node) {
  Owner owner;
  read_mapping(node, json_schema<Owner>(), owner);
  return owner;
}

// A document whose key `schema` says what it is.
template <JsonMapping Owner>
nlohmann::json json_document(std::string_view schema, const Owner& owner) {
  nlohmann::json json = json_mapping(owner);
  json["schema"] = schema;
  return json;
}
// Throws InputError where the key `schema` has another value.
void require_schema(const JsonNode& document, const nlohmann::json& schema);
// Throws InputError, first where the document is of another schema. `what` names it in messages ("run.json").
nlohmann::json parse_document(std::string_view text, const std::string& what, std::string_view schema);
template <JsonMapping Owner>
Owner read_document(std::string_view text, const std::string& what, std::string_view schema) {
  return read_mapping<Owner>(JsonNode(parse_document(text, what, schema), what));
}

// Values. A number that is not finite is null, and null is NaN, unless the words say finite or give a range; a mapping
// of finite numbers leaves out those that are not. A whole number without a range is at least 0, in a list any.

void read_value(const JsonNode& node, const FieldDoc& words, std::string& value);
void read_value(const JsonNode& node, const FieldDoc& words, double& value);
void read_value(const JsonNode& node, const FieldDoc& words, bool& value);
std::int64_t read_whole(const JsonNode& node, const FieldDoc& words, std::int64_t most);
std::uint64_t read_unsigned(const JsonNode& node);
std::size_t read_choice(const JsonNode& node, const FieldDoc& words);
std::int64_t read_any_whole(const JsonNode& node);  // of 32 bits
std::string list_type(const std::string& of);       // "list of integers"

template <typename T>
struct ListOf : std::false_type {};
template <typename T>
struct ListOf<std::vector<T>> : std::true_type {};
template <typename T>
struct NamesOf : std::false_type {};
template <typename T, typename Less>
struct NamesOf<std::map<std::string, T, Less>> : std::true_type {
  using Value = T;
};
template <typename T>
struct NamesOf<NamedValues<T>> : std::true_type {
  using Value = T;
};

template <typename T>
nlohmann::json json_value(const FieldDoc& words, const T& value) {
  if constexpr (OptionalValue<T>::value) {
    return value ? json_value(words, *value) : nlohmann::json();
  } else if constexpr (std::is_same_v<T, double>) {
    return number_or_null(value);
  } else if constexpr (std::is_enum_v<T>) {
    return words.choices.at(static_cast<std::size_t>(value));
  } else if constexpr (JsonMapping<T>) {
    return json_mapping(value);
  } else if constexpr (ListOf<T>::value) {
    nlohmann::json list = nlohmann::json::array();
    for (const auto& element : value) list.push_back(json_value(words, element));
    return list;
  } else if constexpr (NamesOf<T>::value) {
    nlohmann::json names = nlohmann::json::object();
    for (const auto& [name, entry] : value)
      if (nlohmann::json json = json_value(words, entry); !words.finite || !json.is_null())
        names[name] = std::move(json);
    return names;
  } else {
    return value;
  }
}

template <typename T>
void read_json(const JsonNode& node, const FieldDoc& words, T& value) {
  if constexpr (std::is_same_v<T, nlohmann::json>) {
    node.require_mapping();
    value = node.value();
  } else if constexpr (OptionalValue<T>::value) {
    value.reset();
    if (!node.value().is_null()) read_json(node, words, value.emplace());
  } else if constexpr (std::is_enum_v<T>) {
    value = static_cast<T>(read_choice(node, words));
  } else if constexpr (std::is_same_v<T, std::uint64_t>) {
    value = read_unsigned(node);
  } else if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
    value = static_cast<T>(read_whole(node, words, std::numeric_limits<T>::max()));
  } else if constexpr (JsonMapping<T>) {
    value = read_mapping<T>(node);
  } else if constexpr (ListOf<T>::value) {
    node.require_list();
    value.clear();
    value.reserve(node.value().size());
    for (std::size_t i = 0; i < node.value().size(); ++i) {
      if constexpr (std::is_same_v<typename T::value_type, int>)
        value.push_back(static_cast<int>(read_any_whole(node.element(i))));
      else
        read_json(node.element(i), words, value.emplace_back());
    }
  } else if constexpr (NamesOf<T>::value) {
    node.require_mapping();
    std::map<std::string, typename NamesOf<T>::Value> names;
    for (const auto& [name, entry] : node.value().items()) read_json(node.entry(name, entry), words, names[name]);
    if constexpr (std::is_constructible_v<T, decltype(names)>)
      value = T(std::move(names));
    else
      value = T(names.begin(), names.end());
  } else {
    read_value(node, words, value);
  }
}

template <typename T>
std::string json_type(const FieldDoc& words) {
  if constexpr (OptionalValue<T>::value) {
    using Value = typename OptionalValue<T>::Value;
    return json_type<Value>(words) + (std::is_same_v<Value, bool> ? ", null" : " or null");
  } else if constexpr (ListOf<T>::value) {
    return list_type(json_type<typename T::value_type>(words));
  } else if constexpr (NamesOf<T>::value) {
    return "name: " + json_type<typename NamesOf<T>::Value>(words);
  } else if constexpr (std::is_same_v<T, bool>) {
    return "true, false";
  } else if constexpr (std::is_same_v<T, double>) {
    return words.finite || words.range.is_set() ? "number" : "number or null";
  } else if constexpr (std::is_integral_v<T>) {
    return std::is_same_v<T, std::uint64_t> ? "integer, 64 bits" : "integer";
  } else {
    return JsonMapping<T> || std::is_same_v<T, nlohmann::json> ? "object" : "text";
  }
}

// SQLite's integers are too small for a seed of 64 bits without a sign.
template <typename T>
std::string sql_column() {
  if constexpr (OptionalValue<T>::value) {
    return std::is_same_v<typename OptionalValue<T>::Value, bool> ? "INTEGER" : "";
  } else if constexpr (std::is_same_v<T, double>) {
    return "REAL";
  } else if constexpr (std::is_same_v<T, std::string> || std::is_enum_v<T> || std::is_same_v<T, std::uint64_t>) {
    return "TEXT NOT NULL";
  } else {
    return std::is_integral_v<T> ? "INTEGER NOT NULL" : "";
  }
}

template <typename T>
std::vector<JsonDoc> json_members() {
  if constexpr (JsonMapping<T>)
    return std::vector<JsonDoc>(json_schema<T>().begin(), json_schema<T>().end());
  else if constexpr (ListOf<T>::value)
    return json_members<typename T::value_type>();
  else
    return {};
}

template <typename Owner>
template <typename Member>
JsonKey<Owner>::JsonKey(FieldDoc words, Member member) : JsonDoc{std::move(words), "", "", {}} {
  using Value = std::remove_cvref_t<std::invoke_result_t<Member, Owner&>>;
  type = json_type<Value>(*this);
  column = sql_column<Value>();
  members = json_members<Value>();
  const FieldDoc said = *this;
  write = [said, member](const Owner& owner) { return json_value(said, std::invoke(member, owner)); };
  read = [said, member](const JsonNode& node, Owner& owner) { read_json(node, said, std::invoke(member, owner)); };
}

// Keys of forms that tables share.

// The name of a number that is never null.
inline FieldDoc finite_key(std::string name) { return {.name = std::move(name), .finite = true}; }

// A key whose value is a mapping of members of the owner itself.
template <typename Owner>
JsonKey<Owner> json_group(FieldDoc words, const JsonSchema<Owner>& schema) {
  return {std::move(words), "object", [schema](const Owner& owner) { return json_mapping(owner, schema); },
          [schema](const JsonNode& node, Owner& owner) { read_mapping(node, schema, owner); }};
}

// The keys of a part that stand among its owner's.
template <typename Owner, typename Part>
JsonSchema<Owner> json_keys(Part Owner::*member, const JsonSchema<Part>& schema) {
  JsonSchema<Owner> keys;
  for (const JsonKey<Part>& key : schema)
    keys.emplace_back(
        key, key.type, [key, member](const Owner& owner) { return key.write(owner.*member); },
        [key, member](const JsonNode& node, Owner& owner) { key.read(node, owner.*member); });
  return keys;
}

// The value under a key of a mapping; throws where the key is absent.
template <typename T>
T json_at(const JsonNode& node, std::string_view key) {
  T value{};
  read_json(node.at(key), {}, value);
  return value;
}

}  // namespace duet
