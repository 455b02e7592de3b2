#include "duet/robots/yaml_section.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>
#include <vector>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

// A node takes some hundred bytes, and two bytes of text can be one: what a text holds is counted before any is made.
constexpr int kMostNodes = 200000;

class NodeCounter final : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t, const std::string&) override {
    count(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnMapEnd() override {}

 private:
  void count(const YAML::Mark& mark) {
    if (++nodes_ > kMostNodes)
      throw YAML::ParserException(mark, fmt::format("more than {} keys and values", kMostNodes));
  }

  int nodes_ = 0;
};

}  // namespace

YAML::Node parse_yaml(const std::string& text, const std::string& file) {
  try {
    std::istringstream stream(text);
    NodeCounter counter;
    YAML::Parser(stream).HandleNextDocument(counter);
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    // A text with ": " in it is taken for a map value; the library says only "illegal map value".
    const char* hint = error.msg == YAML::ErrorMsg::MAP_VALUE ? " (a text that holds \": \" stands in quotes)" : "";
    throw InputError(fmt::format("{}:{}: expected YAML, found: {}{}", file, error.mark.line + 1, error.msg, hint));
  }
}

std::string describe(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return "nothing";
  if (node.IsScalar()) return fmt::format("'{}'", excerpt(node.Scalar()));
  return node.IsSequence() ? fmt::format("a list of {}", node.size()) : "a mapping";
}

YamlSection::YamlSection(std::string file, const YAML::Node& node, std::string where,
                         const std::vector<const char*>& known)
    : file_(std::move(file)), node_(node), where_(std::move(where)) {
  if (!node_.IsMap()) fail(line(), fmt::format("expected a mapping, found {}", describe(node_)));
  const std::vector<std::string> names(known.begin(), known.end());
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) fail(line_of(entry.first), "expected a plain key, found " + describe(entry.first));
    const std::string& key = entry.first.Scalar();
    if (std::find(names.begin(), names.end(), key) == names.end())
      fail(line_of(entry.first), unknown_name_message("key", key, names));
    if (!lines_.emplace(key, line_of(entry.first)).second)
      fail(line_of(entry.first), fmt::format("expected each key once, found '{}' again", excerpt(key)));
  }
}

int YamlSection::line(const char* key) const {
  const auto it = lines_.find(key);
  return it == lines_.end() ? line() : it->second;
}

void YamlSection::fail(int line, const std::string& message) const {
  throw InputError(fmt::format("{}:{}: {}: {}", file_, line, excerpt(where_), excerpt(message, kShownSentence)));
}

void YamlSection::fail_key(const char* key, const std::string& message) const {
  fail(line(key), fmt::format("key '{}': {}", key, message));
}

void YamlSection::refuse_key(const char* key, std::string_view expected, const YAML::Node& found) const {
  fail_key(key, fmt::format("expected {}, found {}", expected, describe(found)));
}

void YamlSection::require_schema(std::string_view schema) const {
  if (const std::string found = text("schema"); found != schema)
    fail(line("schema"), fmt::format("expected schema {}, found {}", schema, excerpt(found)));
}

YAML::Node YamlSection::node(const char* key) const {
  YAML::Node value = node_[key];
  if (!value) fail(line(), fmt::format("expected the key '{}', found none", key));
  return value;
}

std::string YamlSection::text(const char* key) const {
  const YAML::Node value = node(key);
  if (!value.IsScalar() || value.Scalar().empty()) refuse_key(key, "a text", value);
  return value.Scalar();
}

double YamlSection::finite(const YAML::Node& node, const char* key) const {
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value))
    refuse_key(key, "a finite number", node);
  return value;
}

double YamlSection::number(const char* key) const { return finite(node(key), key); }

Eigen::Vector3d YamlSection::vector3(const char* key) const {
  const YAML::Node value = node(key);
  if (!value.IsSequence() || value.size() != 3) refuse_key(key, "three numbers", value);
  return {finite(value[0], key), finite(value[1], key), finite(value[2], key)};
}

std::vector<YAML::Node> YamlSection::items(const char* key) const {
  if (!has(key)) return {};
  const YAML::Node value = node(key);
  if (!value.IsSequence()) refuse_key(key, "a list", value);
  return {value.begin(), value.end()};
}

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
  if (!node.IsMap()) item.refuse_key(kTagsKey, "a mapping", node);
  Tags tags;
  for (const auto& entry : node) {
    const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
    std::string fault = tag_fault(of, name, entry.second);
    if (fault.empty() && !tags.emplace(name, entry.second.Scalar()).second)
      fault = fmt::format("expected each name once, found '{}' twice", name);
    if (!fault.empty()) item.fail(std::max(entry.first.Mark().line, 0) + 1, fmt::format("key 'tags': {}", fault));
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
