// Strict reading of JSON objects: each key is named once, a missing, an unknown or a wrongly typed one is an InputError
// that names it. Used by every reader of this room.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "duet/core/json.h"
#include "duet/core/named_values.h"
#include "duet/core/task.h"
#include "duet/statistics/statistics.h"

namespace duet {

// null for a number that is not finite: JSON has no NaN.
nlohmann::json number_or_null(double value);
nlohmann::json numbers_or_null(const std::map<std::string, double>& values);  // an object, likewise
nlohmann::json json_of(const Interval& interval);                             // [low, high]

class JsonFields {
 public:
  // `what` names the object in messages ("episode row", "run.json"). Throws InputError where `json` is no object.
  JsonFields(const nlohmann::json& json, std::string what);

  bool has(const std::string& key);                  // a key that may be absent
  const nlohmann::json& at(const std::string& key);  // throws InputError where it is missing
  std::string text(const std::string& key);
  bool boolean(const std::string& key);
  std::int64_t integer(const std::string& key);
  std::uint64_t unsigned_integer(const std::string& key);
  int count(const std::string& key);             // a whole number of at least 0
  double number(const std::string& key);         // finite by JSON's grammar
  double number_or_nan(const std::string& key);  // null reads as NaN
  const nlohmann::json& list(const std::string& key);
  std::map<std::string, double> numbers(const std::string& key, bool null_is_nan);
  std::map<std::string, bool> booleans(const std::string& key);
  std::map<std::string, std::string, std::less<>> texts(const std::string& key);

  // Throws InputError for a key that nobody asked for, with the nearest known one.
  void refuse_unknown() const;
  [[nodiscard]] const std::string& what() const { return what_; }

 private:
  [[noreturn]] void wrong_type(const std::string& key, std::string_view expected, const nlohmann::json& found) const;
  double number_of(const std::string& key, const nlohmann::json& value, bool null_is_nan) const;

  const nlohmann::json& json_;
  std::string what_;
  std::set<std::string> asked_;
};

// The members of a struct that is one JSON object, as a table: name, member, meaning. Writing and strict reading, the
// columns of results.sqlite and docs/reference/row-fields.md are made from it. Tables are constants; thread-safe.

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
