#include "duet/robots/yaml_schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

std::string quoted_range(const FieldRange& range) {
  if (std::isfinite(range.high)) return fmt::format("a number in [{:g}, {:g}]", range.low, range.high);
  return fmt::format("a number {} {:g}", range.with_low ? ">=" : ">", range.low);
}

int whole(const YamlSection& section, const FieldDoc& words, double value) {
  if (value != std::floor(value) || value < words.range.low || value > words.range.high)
    section.fail(section.line(words.name.c_str()),
                 fmt::format("'{}': expected a whole number in [{:.0f}, {:.0f}], found {}", words.name, words.range.low,
                             words.range.high, value));
  return static_cast<int>(value);
}

}  // namespace

void read_value(const YamlSection& section, const FieldDoc& words, double& out) {
  const double value = section.number(words.name.c_str());
  const FieldRange& range = words.range;
  if (value > range.high || value < range.low || (value == range.low && !range.with_low))
    section.fail(section.line(words.name.c_str()),
                 fmt::format("'{}': expected {}, found {}", words.name, quoted_range(range), value));
  out = value;
}

void read_value(const YamlSection& section, const FieldDoc& words, int& out) {
  out = whole(section, words, section.number(words.name.c_str()));
}

void read_value(const YamlSection& section, const FieldDoc& words, bool& out) {
  out = words.choices.empty() ? section.flag_or(words.name.c_str(), false) : read_choice(section, words) == 1;
}

void read_value(const YamlSection& section, const FieldDoc& words, std::string& out) {
  out = section.text(words.name.c_str());
}

void read_value(const YamlSection& section, const FieldDoc& words, Eigen::Vector3d& out) {
  out = section.vector3(words.name.c_str());
}

void read_value(const YamlSection& section, const FieldDoc& words, std::vector<double>& out) {
  const char* key = words.name.c_str();
  const YAML::Node node = section.node(key);
  out.clear();
  for (const YAML::Node& item : node.IsScalar() ? std::vector{node} : section.items(key)) {
    double value = 0.0;
    if (!item.IsScalar() || !YAML::convert<double>::decode(item, value) || !std::isfinite(value))
      section.fail(section.line(key), fmt::format("'{}': expected finite numbers, found {}", key, describe(item)));
    out.push_back(value);
  }
  if (out.empty()) section.fail(section.line(key), fmt::format("'{}': expected numbers, found none", key));
}

void read_value(const YamlSection& section, const FieldDoc& words, std::vector<std::string>& out) {
  const char* key = words.name.c_str();
  out.clear();
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar() || item.Scalar().empty())
      section.fail(section.line(key), fmt::format("'{}': expected texts, found {}", key, describe(item)));
    out.push_back(item.Scalar());
  }
}

std::size_t read_choice(const YamlSection& section, const FieldDoc& words) {
  const std::string word = section.text(words.name.c_str());
  const auto found = std::ranges::find(words.choices, word);
  if (found == words.choices.end())
    section.fail(section.line(words.name.c_str()), unknown_name_message(words.name, word, words.choices));
  return static_cast<std::size_t>(found - words.choices.begin());
}

std::vector<int> whole_numbers(const YamlSection& section, const FieldDoc& words) {
  if (!section.has(words.name.c_str())) return {};
  std::vector<double> values;
  read_value(section, words, values);
  std::vector<int> numbers;
  numbers.reserve(values.size());
  for (const double value : values) numbers.push_back(whole(section, words, value));
  return numbers;
}

}  // namespace duet
