#include "duet/core/field.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kLargestWhole = 9.0e15;  // below it a double holds each whole number

std::optional<double> number_of(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  return parse_number(text);
}

FieldRange whole_range(const FieldRange& range, double least, double most) {
  return {std::max(range.low, std::max(least, -kLargestWhole)), std::min(range.high, std::min(most, kLargestWhole))};
}

std::string lowered(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

}  // namespace

bool contains(const FieldRange& range, double value) {
  return value <= range.high && (range.with_low ? value >= range.low : value > range.low);
}

std::string values_of_number(const FieldRange& range, const std::string& unit) {
  const std::string of_unit = unit.empty() ? "" : " " + unit;
  const std::string from = fmt::format("{} {:g}", range.with_low ? "from" : "above", range.low);
  if (std::isfinite(range.low) && std::isfinite(range.high))
    return fmt::format("a number {}, at most {:g}{}", from, range.high, of_unit);
  if (std::isfinite(range.high)) return fmt::format("a finite number, at most {:g}{}", range.high, of_unit);
  if (range.low == 0.0 && range.with_low) return "a finite number, zero or more";
  return std::isfinite(range.low) ? fmt::format("a finite number {}{}", from, of_unit) : "a finite number";
}

std::string values_of_whole(const FieldRange& range, double least, double most) {
  const FieldRange whole = whole_range(range, least, most);
  return fmt::format("a whole number, {:.0f} to {:.0f}", whole.low, whole.high);
}

std::string assign_value(const FieldDoc& words, const std::string& text, const FieldRange& range, double& out) {
  const std::optional<double> value = number_of(text);
  if (!value || !contains(range, *value)) return values_of_number(range, words.unit);
  out = *value;
  return "";
}

std::string assign_value(const FieldDoc& words, const std::string& text, const FieldRange&, bool& out) {
  const std::string word = lowered(text);
  const auto is = [&](std::initializer_list<const char*> known) {
    return std::any_of(known.begin(), known.end(), [&](const char* name) { return word == name; });
  };
  const bool is_flag = words.choices.at(0) == "false" || words.choices.at(0) == "off";
  const bool on = text == words.choices.at(1) || (is_flag && is({"true", "on", "yes", "y"}));
  if (!on && text != words.choices.at(0) && !(is_flag && is({"false", "off", "no", "n"})))
    return words.choices == flag_words() ? "true or false" : fmt::format("{}", fmt::join(words.choices, ", "));
  out = on;
  return "";
}

std::string assign_value(const FieldDoc& words, const std::string& text, const FieldRange&, std::string& out) {
  std::size_t index = 0;
  if (!words.choices.empty())
    if (std::string expected = assign_choice(words, text, index); !expected.empty()) return expected;
  out = text;
  return "";
}

std::string assign_whole(const std::string& text, const FieldRange& range, double least, double most, double& out) {
  const std::optional<double> value = number_of(text);
  if (!value || *value != std::floor(*value) || !contains(whole_range(range, least, most), *value))
    return values_of_whole(range, least, most);
  out = *value;
  return "";
}

std::string assign_choice(const FieldDoc& words, const std::string& text, std::size_t& out) {
  const auto found = std::find(words.choices.begin(), words.choices.end(), text);
  if (found == words.choices.end()) return fmt::format("{}", fmt::join(words.choices, ", "));
  out = static_cast<std::size_t>(found - words.choices.begin());
  return "";
}

std::string value_text(const FieldDoc&, double value) { return fmt::format("{}", value); }
std::string value_text(const FieldDoc& words, bool value) { return words.choices.at(value ? 1 : 0); }
std::string value_text(const FieldDoc&, const std::string& value) { return value; }
std::string whole_text(std::int64_t value) { return fmt::format("{}", value); }

std::vector<std::string> flag_words() { return {"false", "true"}; }

std::string field_refusal(const FieldDoc& words, const std::string& expected, const std::string& text,
                          std::string_view of) {
  if (words.choices.size() > 2 || (!words.choices.empty() && words.choices[1] != "true"))
    return unknown_name_message(words.name, text, words.choices);
  const std::string place = of.empty() ? words.name : fmt::format("{} '{}'", of, words.name);
  return fmt::format("{}: expected {}, found {}", place, expected,
                     number_of(text) ? text : fmt::format("'{}'", excerpt(text)));
}

}  // namespace duet
