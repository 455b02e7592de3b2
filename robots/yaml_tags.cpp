#include "duet/robots/yaml_tags.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

#include "duet/core/plain_name.h"

namespace duet {
namespace {

// The fault of a tag; "" for none.
std::string tag_fault(std::string_view of, const std::string& name, const YAML::Node& value) {
  if (!is_plain_name(name)) return plain_name_message(name);
  if (std::ranges::find(kDerivedTags, row_tag(of, name)) != kDerivedTags.end())
    return fmt::format("expected a name of your own, found '{}', which follows from what the suite runs", name);
  if (!value.IsScalar() || !is_plain_name(value.Scalar()))
    return fmt::format("{}: expected one word or number (letters, digits and _ . + -), found {}", name,
                       describe(value));
  const std::string& text = value.Scalar();
  const auto whole = std::ranges::find(kWholeTags, name, &WholeTag::name);
  const bool digits = std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
  if (whole == kWholeTags.end() || (digits && text.size() <= whole->digits)) return "";
  return fmt::format("{}: expected a whole number of at most {} digits, found '{}'", name, whole->digits, text);
}

}  // namespace

Tags read_tags(const YamlSection& item, std::string_view of) {
  if (!item.has(kTagsKey)) return {};
  const YAML::Node node = item.node(kTagsKey);
  if (!node.IsMap()) item.fail(item.line(kTagsKey), fmt::format("tags: expected a mapping, found {}", describe(node)));
  Tags tags;
  for (const auto& entry : node) {
    const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
    std::string fault = tag_fault(of, name, entry.second);
    if (fault.empty() && !tags.emplace(name, entry.second.Scalar()).second)
      fault = fmt::format("expected each name once, found '{}' twice", name);
    if (!fault.empty()) item.fail(std::max(entry.first.Mark().line, 0) + 1, fmt::format("tags: {}", fault));
  }
  return tags;
}

std::string tags_yaml(const Tags& tags) {
  if (tags.empty()) return "";
  std::vector<std::string> texts;
  texts.reserve(tags.size());
  for (const auto& [name, value] : tags) texts.push_back(fmt::format("{}: {}", name, value));
  return fmt::format(", {}: {{{}}}", kTagsKey, fmt::join(texts, ", "));
}

}  // namespace duet
