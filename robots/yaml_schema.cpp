#include "duet/robots/yaml_schema.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace duet {
std::string scalar_text(const YamlSection& section, const FieldDoc& words, const std::string& expected) {
  const char* key = words.name.c_str();
  const YAML::Node node = section.node(key);
  if (!node.IsScalar() || node.Scalar().empty()) section.refuse_key(key, expected, node);
  return node.Scalar();
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
      section.refuse_key(key, "finite numbers", item);
    out.push_back(value);
  }
  if (out.empty()) section.fail_key(key, "expected numbers, found none");
}

void read_value(const YamlSection& section, const FieldDoc& words, std::vector<std::string>& out) {
  const char* key = words.name.c_str();
  out.clear();
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar() || item.Scalar().empty()) section.refuse_key(key, "texts", item);
    out.push_back(item.Scalar());
  }
}

std::vector<int> whole_numbers(const YamlSection& section, const FieldDoc& words) {
  if (!section.has(words.name.c_str())) return {};
  std::vector<double> values;
  read_value(section, words, values);
  std::vector<int> numbers;
  numbers.reserve(values.size());
  for (const double value : values) {
    int number = 0;
    const std::string text = value_text(words, value), expected = assign_field(words, text, words.range, number);
    if (!expected.empty()) section.fail_key(words.name.c_str(), fmt::format("expected {}, found {}", expected, value));
    numbers.push_back(number);
  }
  return numbers;
}

}  // namespace duet
