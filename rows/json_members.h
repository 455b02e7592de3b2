// The members of a struct that is one JSON object, as a table: name, member, meaning. Writing and strict reading, the
// columns of results.sqlite and docs/reference/row-fields.md are made from it. Tables are constants; thread-safe.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "duet/core/outcome.h"
#include "duet/rows/json_fields.h"
#include "duet/core/named_values.h"

namespace duet {

// A member of an Owner; its type says what stands in JSON. More: types beside those that any object may have. They need
// json_value(value, finite), read_value(fields, key, finite, value) and value_words(ValueType, finite), as below.
template <typename Owner, typename... More>
struct JsonMember {
  std::string_view name;
  std::variant<std::string Owner::*, int Owner::*, long Owner::*, std::uint64_t Owner::*, double Owner::*,
               bool Owner::*, std::optional<bool> Owner::*, Outcome Owner::*, NamedNumbers Owner::*,
               NamedFlags Owner::*, std::vector<std::string> Owner::*, std::vector<int> Owner::*,
               std::vector<std::vector<int>> Owner::*, More Owner::*...>
      member;
  std::string_view meaning;    // part of a sentence
  std::string_view unit = "";  // "" where it has none or its meaning says it
  // For numbers: null is no value. A mapping leaves those out that are not finite; any other number is written as null
  // where it is not, and null is read as NaN.
  bool finite = false;
  bool optional = false;  // of a mapping: an empty one is not written, and a key that is absent is an empty one
};

nlohmann::json json_value(const std::string& value, bool finite);
nlohmann::json json_value(int value, bool finite);
nlohmann::json json_value(long value, bool finite);
nlohmann::json json_value(std::uint64_t value, bool finite);
nlohmann::json json_value(double value, bool finite);
nlohmann::json json_value(bool value, bool finite);
nlohmann::json json_value(const std::optional<bool>& value, bool finite);
nlohmann::json json_value(Outcome value, bool finite);
nlohmann::json json_value(const NamedNumbers& values, bool finite);
nlohmann::json json_value(const NamedFlags& values, bool finite);
nlohmann::json json_value(const std::vector<std::string>& values, bool finite);
nlohmann::json json_value(const std::vector<int>& values, bool finite);
nlohmann::json json_value(const std::vector<std::vector<int>>& values, bool finite);

// Whole numbers are at least 0, but for those of lists. Throw InputError naming the object, the key and the fault.
void read_value(JsonFields& fields, const std::string& key, bool finite, std::string& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, int& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, long& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, std::uint64_t& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, double& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, bool& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, std::optional<bool>& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, Outcome& value);
void read_value(JsonFields& fields, const std::string& key, bool finite, NamedNumbers& values);
void read_value(JsonFields& fields, const std::string& key, bool finite, NamedFlags& values);
void read_value(JsonFields& fields, const std::string& key, bool finite, std::vector<std::string>& values);
void read_value(JsonFields& fields, const std::string& key, bool finite, std::vector<int>& values);
void read_value(JsonFields& fields, const std::string& key, bool finite, std::vector<std::vector<int>>& values);

template <typename Value>
struct ValueType {};

// The type in words, for the documentation: "integer", "name: number".
std::string_view value_words(ValueType<std::string>, bool finite);
std::string_view value_words(ValueType<int>, bool finite);
std::string_view value_words(ValueType<long>, bool finite);
std::string_view value_words(ValueType<std::uint64_t>, bool finite);
std::string_view value_words(ValueType<double>, bool finite);
std::string_view value_words(ValueType<bool>, bool finite);
std::string_view value_words(ValueType<std::optional<bool>>, bool finite);
std::string_view value_words(ValueType<Outcome>, bool finite);
std::string_view value_words(ValueType<NamedNumbers>, bool finite);
std::string_view value_words(ValueType<NamedFlags>, bool finite);
std::string_view value_words(ValueType<std::vector<std::string>>, bool finite);
std::string_view value_words(ValueType<std::vector<int>>, bool finite);
std::string_view value_words(ValueType<std::vector<std::vector<int>>>, bool finite);

template <typename Owner, typename... More>
void write_member(const JsonMember<Owner, More...>& known, const Owner& owner, nlohmann::json& json) {
  std::visit(
      [&](auto member) {
        nlohmann::json value = json_value(owner.*member, known.finite);
        if (!known.optional || !value.empty()) json[std::string(known.name)] = std::move(value);
      },
      known.member);
}

template <typename Owner, typename... More>
void read_member(const JsonMember<Owner, More...>& known, JsonFields& fields, Owner& owner) {
  if (known.optional && !fields.has(std::string(known.name))) return;
  std::visit([&](auto member) { read_value(fields, std::string(known.name), known.finite, owner.*member); },
             known.member);
}

template <typename Owner, typename... More>
std::string_view member_words(const JsonMember<Owner, More...>& known) {
  return std::visit([&]<typename Value>(Value Owner::*) { return value_words(ValueType<Value>(), known.finite); },
                    known.member);
}

}  // namespace duet
