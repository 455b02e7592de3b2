#include "duet/robots/yaml_section.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

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
  if (node.IsScalar()) return fmt::format("'{}'", shown(node.Scalar()));
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
      fail(line_of(entry.first), fmt::format("expected each key once, found '{}' again", shown(key)));
  }
}

int YamlSection::line(const char* key) const {
  const auto it = lines_.find(key);
  return it == lines_.end() ? line() : it->second;
}

void YamlSection::fail(int line, const std::string& message) const {
  throw InputError(fmt::format("{}:{}: {}: {}", file_, line, shown(where_), shown(message, kShownSentence)));
}

YAML::Node YamlSection::node(const char* key) const {
  YAML::Node value = node_[key];
  if (!value) fail(line(), fmt::format("expected the key '{}', found none", key));
  return value;
}

std::string YamlSection::text(const char* key) const {
  const YAML::Node value = node(key);
  if (!value.IsScalar() || value.Scalar().empty())
    fail(line(key), fmt::format("'{}': expected a text, found {}", key, describe(value)));
  return value.Scalar();
}

double YamlSection::finite(const YAML::Node& node, const char* key) const {
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value))
    fail(line(key), fmt::format("'{}': expected a finite number, found {}", key, describe(node)));
  return value;
}

double YamlSection::number(const char* key) const { return finite(node(key), key); }

std::optional<double> YamlSection::optional_number(const char* key) const {
  if (!has(key)) return std::nullopt;
  return number(key);
}

bool YamlSection::flag_or(const char* key, bool fallback) const {
  if (!has(key)) return fallback;
  const YAML::Node value = node(key);
  bool flag = false;
  if (!value.IsScalar() || !YAML::convert<bool>::decode(value, flag))
    fail(line(key), fmt::format("'{}': expected true or false, found {}", key, describe(value)));
  return flag;
}

Eigen::Vector3d YamlSection::vector3(const char* key) const {
  const YAML::Node value = node(key);
  if (!value.IsSequence() || value.size() != 3)
    fail(line(key), fmt::format("'{}': expected three numbers, found {}", key, describe(value)));
  return {finite(value[0], key), finite(value[1], key), finite(value[2], key)};
}

std::vector<YAML::Node> YamlSection::items(const char* key) const {
  if (!has(key)) return {};
  const YAML::Node value = node(key);
  if (!value.IsSequence()) fail(line(key), fmt::format("'{}': expected a list, found {}", key, describe(value)));
  return {value.begin(), value.end()};
}

}  // namespace duet
