// One value of a struct as users name it, declared once: a table of fields is what reads, writes, checks and hashes
// such a struct, and what `duet list`, --help and docs/reference are made from. Tables are constants; thread-safe.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

// The range of a number.
struct FieldRange {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool with_low = true;  // whether `low` itself is allowed

  [[nodiscard]] bool is_set() const { return std::isfinite(low) || std::isfinite(high); }
};

bool contains(const FieldRange& range, double value);  // false for NaN

// The name and the meaning of a field. `choices` are the texts of an enumeration in the order of its enumerators from
// 0, or of a flag: off, then on.
struct FieldDoc {
  std::string name = {};
  std::string meaning = {};  // part of a sentence
  std::string unit = {};     // "" where it has none
  FieldRange range = {};
  std::vector<std::string> choices = {};
  bool finite = false;    // of a number in JSON: null is no value of it
  bool optional = false;  // of a key in JSON: absent where its value is null or empty
};

// A field of an Owner. `text` gives its value as reading takes it ("" for an empty text or optional); two values with
// one text are one value. `assign` gives what was expected where the text is no value of it, and "" where it is.
template <typename Owner>
struct Field : FieldDoc {
  std::string values = {};  // what it may be, for a sentence
  std::function<std::string(const Owner&)> text = {};
  std::function<std::string(Owner&, const std::string&, const FieldRange&)> assign = {};
  std::function<double(const Owner&)> least = {};  // of another field before it, below which this one may not be
};

template <typename Owner>
using FieldTable = std::vector<Field<Owner>>;

// A field for a person: of lists, help and reference pages.
struct FieldRow {
  std::string name, values, fallback, meaning;
};

// The text forms. `assign_value` gives what was expected, "" where `out` was set. Numbers in the C locale, a sign
// allowed; whole ones at most 9e15 in size; flags as in `choices`, or true, false, on, off, yes, no.
std::string assign_value(const FieldDoc& words, const std::string& text, const FieldRange& range, double& out);
std::string assign_value(const FieldDoc& words, const std::string& text, const FieldRange& range, bool& out);
std::string assign_value(const FieldDoc& words, const std::string& text, const FieldRange& range, std::string& out);
std::string assign_whole(const std::string& text, const FieldRange& range, double least, double most, double& out);
std::string assign_choice(const FieldDoc& words, const std::string& text, std::size_t& out);
std::string value_text(const FieldDoc& words, double value);
std::string value_text(const FieldDoc& words, bool value);
std::string value_text(const FieldDoc& words, const std::string& value);
std::string whole_text(std::int64_t value);

// "a number above 0, at most 5 m", "a whole number, 1 to 90", "left, right", "off, on", "a text".
std::string values_of_number(const FieldRange& range, const std::string& unit);
std::string values_of_whole(const FieldRange& range, double least, double most);

// "key 'NAME': expected WHAT, found TEXT"; of a choice the sentence that asks "did you mean". `of`: "option";
// "" for a name that says itself what it is ("--height").
std::string field_refusal(const FieldDoc& words, const std::string& expected, const std::string& text,
                          std::string_view of = "key");

// The texts of a flag that has no others.
std::vector<std::string> flag_words();

template <typename T>
struct OptionalValue : std::false_type {
  using Value = T;
};
template <typename T>
struct OptionalValue<std::optional<T>> : std::true_type {
  using Value = T;
};

template <typename T>
std::string assign_field(const FieldDoc& words, const std::string& text, const FieldRange& range, T& out) {
  if constexpr (OptionalValue<T>::value) {
    typename OptionalValue<T>::Value value{};
    std::string expected = assign_field(words, text, range, value);
    if (expected.empty()) out = value;
    return expected;
  } else if constexpr (std::is_enum_v<T>) {
    std::size_t index = 0;
    std::string expected = assign_choice(words, text, index);
    if (expected.empty()) out = static_cast<T>(index);
    return expected;
  } else if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
    double value = 0.0;
    std::string expected = assign_whole(text, range, static_cast<double>(std::numeric_limits<T>::min()),
                                        static_cast<double>(std::numeric_limits<T>::max()), value);
    if (expected.empty()) out = static_cast<T>(value);
    return expected;
  } else {
    return assign_value(words, text, range, out);
  }
}

template <typename T>
std::string field_text(const FieldDoc& words, const T& value) {
  if constexpr (OptionalValue<T>::value) {
    return value ? field_text(words, *value) : std::string();
  } else if constexpr (std::is_enum_v<T>) {
    return words.choices.at(static_cast<std::size_t>(value));
  } else if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
    return whole_text(static_cast<std::int64_t>(value));
  } else {
    return value_text(words, value);
  }
}

// The values that `duet list` says are allowed.
template <typename T>
std::string field_values(const FieldDoc& words, const FieldRange& range) {
  if constexpr (OptionalValue<T>::value) {
    return field_values<typename OptionalValue<T>::Value>(words, range);
  } else if constexpr (std::is_same_v<T, double>) {
    return values_of_number(range, words.unit);
  } else if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
    return values_of_whole(range, static_cast<double>(std::numeric_limits<T>::min()),
                           static_cast<double>(std::numeric_limits<T>::max()));
  } else {
    std::string joined;
    for (const std::string& choice : words.choices) joined += (joined.empty() ? "" : ", ") + choice;
    return joined.empty() ? "a text" : joined;
  }
}

// The field that `member` gives of an Owner: a pointer to a member, or a function of an owner (const and not) that
// returns a reference. Numbers, whole numbers, flags, texts, enumerations, and optional ones of these.
template <typename Owner, typename Member>
Field<Owner> field(FieldDoc words, Member member) {
  using Value = std::remove_cvref_t<std::invoke_result_t<Member, Owner&>>;
  if constexpr (std::is_same_v<Value, bool>)
    if (words.choices.empty()) words.choices = flag_words();
  Field<Owner> made;
  static_cast<FieldDoc&>(made) = std::move(words);
  made.values = field_values<Value>(made, made.range);
  const FieldDoc said = made;
  made.text = [said, member](const Owner& owner) { return field_text(said, std::invoke(member, owner)); };
  made.assign = [said, member](Owner& owner, const std::string& text, const FieldRange& range) {
    return assign_field(said, text, range, std::invoke(member, owner));
  };
  return made;
}

// The same of a number that may not be below another field before it: a default that is below rises to it.
template <typename Owner, typename Member>
Field<Owner> field(FieldDoc words, Member member, double Owner::*least) {
  Field<Owner> made = field<Owner>(std::move(words), member);
  made.least = [least](const Owner& owner) { return owner.*least; };
  return made;
}

// A field of a type of its own: what it may be, its text, and what sets it from one (what was expected, "" where it is
// set).
template <typename Owner>
Field<Owner> field(FieldDoc words, const std::string& values, std::function<std::string(const Owner&)> text,
                   const std::function<std::string(Owner&, const std::string&)>& assign) {
  Field<Owner> made;
  static_cast<FieldDoc&>(made) = std::move(words);
  made.values = values;
  made.text = std::move(text);
  made.assign = [assign](Owner& owner, const std::string& said, const FieldRange&) { return assign(owner, said); };
  return made;
}

template <typename Owner>
FieldRange range_of(const Field<Owner>& known, const Owner& owner) {
  FieldRange range = known.range;
  if (known.least) range.low = known.least(owner);
  return range;
}

// Sets the field and returns ""; where the text does not fit, returns what was expected.
template <typename Owner>
std::string set_field(const Field<Owner>& known, Owner& owner, const std::string& text) {
  return known.assign(owner, text, range_of(known, owner));
}

// A default that another field's value has left below its range becomes the lowest that is allowed.
template <typename Owner>
void raise_default(const Field<Owner>& known, Owner& owner) {
  if (!known.least || set_field(known, owner, known.text(owner)).empty()) return;
  set_field(known, owner, value_text(known, known.least(owner)));
}

// The names of a table's fields or keys.
template <typename Table>
std::vector<std::string> field_names(const Table& table) {
  std::vector<std::string> names;
  names.reserve(table.size());
  for (const auto& known : table) names.push_back(known.name);
  return names;
}

// None where it is not there.
template <typename Owner>
const Field<Owner>* find_field(const FieldTable<Owner>& table, const std::string& name) {
  for (const Field<Owner>& known : table)
    if (known.name == name) return &known;
  return nullptr;
}

// "{force: 60, duration: 1}": every field in the order of the table but those without a text.
template <typename Owner>
std::string flow_mapping(const FieldTable<Owner>& table, const Owner& owner) {
  std::string text;
  for (const Field<Owner>& known : table)
    if (const std::string value = known.text(owner); !value.empty())
      text += (text.empty() ? "" : ", ") + known.name + ": " + value;
  return '{' + text + '}';
}

template <typename Owner>
std::vector<FieldRow> field_rows(const FieldTable<Owner>& table, const Owner& defaults) {
  std::vector<FieldRow> rows;
  rows.reserve(table.size());
  for (const Field<Owner>& known : table)
    rows.push_back({known.name, known.values, known.text(defaults), known.meaning});
  return rows;
}

// Options by name and text, of a controller or a policy: they set the fields of a struct with a table of fields
// (core/field.h). Listing, checking and documentation are made from the table.

// `defaults` with the options that are given. Throws std::invalid_argument, which begins with `of` and the name
// ("controller 'homie': ..."): a name that is not in the table (with the nearest and all known), a text that is no
// value of its field.
template <typename Owner>
Owner read_options(std::string_view of, std::string_view name, const FieldTable<Owner>& table,
                   const std::map<std::string, std::string>& given, Owner defaults = {}) {
  check_options(of, name, given, field_names(table));
  for (const auto& [option, text] : given) {
    const Field<Owner>& known = *find_field(table, option);
    const std::string expected = set_field(known, defaults, text);
    if (!expected.empty())
      require(false,
              std::string(of) + " '" + std::string(name) + "': " + field_refusal(known, expected, text, "option"));
  }
  return defaults;
}

// Rows {name, fallback, about} of what a controller or a policy says of itself.
template <typename Option, typename Owner>
std::vector<Option> option_list(const FieldTable<Owner>& table, const Owner& defaults = {}) {
  std::vector<Option> list;
  list.reserve(table.size());
  for (const FieldRow& row : field_rows(table, defaults))
    list.push_back({row.name, row.fallback, row.values + "; " + row.meaning});
  return list;
}

}  // namespace duet
