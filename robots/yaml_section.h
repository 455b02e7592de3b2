// Strict reading of one YAML mapping: every key must be known, every value of its type and finite. All errors are
// InputError with file, line, expected and found.
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"

namespace duet {

class YamlSection {
 public:
  // `where` names the mapping in messages ("joint 'left_knee_joint'"). Throws for a node that is not a mapping, a key
  // that is not in `known` (with the nearest one) and a key given twice.
  YamlSection(std::string file, const YAML::Node& node, std::string where, const std::vector<const char*>& known);

  [[nodiscard]] bool has(const char* key) const { return static_cast<bool>(node_[key]); }
  [[nodiscard]] int line() const { return line_of(node_); }
  [[nodiscard]] int line(const char* key) const;  // of the key itself; of the mapping where the key is absent

  // A missing key throws, naming it.
  [[nodiscard]] std::string text(const char* key) const;
  [[nodiscard]] double number(const char* key) const;
  [[nodiscard]] Eigen::Vector3d vector3(const char* key) const;
  // Elements of a list; none where the key is absent.
  [[nodiscard]] std::vector<YAML::Node> items(const char* key) const;
  // The node itself; throws where it is absent.
  [[nodiscard]] YAML::Node node(const char* key) const;

  // The mapping itself.
  [[nodiscard]] const YAML::Node& keys() const { return node_; }

  // Throw InputError("FILE:LINE: WHERE: MESSAGE"), of a key "FILE:LINE: WHERE: key 'KEY': MESSAGE", where a value is
  // refused "expected WHAT, found VALUE".
  [[noreturn]] void fail(int line, const std::string& message) const;
  [[noreturn]] void fail_key(const char* key, const std::string& message) const;
  [[noreturn]] void refuse_key(const char* key, std::string_view expected, const YAML::Node& found) const;
  // Throws where the key `schema` is another.
  void require_schema(std::string_view schema) const;

 private:
  // Counted from 1; an empty document has no mark.
  [[nodiscard]] static int line_of(const YAML::Node& node) { return std::max(node.Mark().line, 0) + 1; }
  [[nodiscard]] double finite(const YAML::Node& node, const char* key) const;

  std::string file_;
  YAML::Node node_;
  std::string where_;
  std::map<std::string, int> lines_;  // of the keys
};

// The document of `text`; throws InputError with file and line for text that is not YAML or holds more than 200,000
// keys and values.
YAML::Node parse_yaml(const std::string& text, const std::string& file);

// The content of a node, for the "found" part of a message: "'text'", "a list", "a mapping", "nothing".
std::string describe(const YAML::Node& node);

// The mapping `tags` of an item of a suite (core/task.h).

inline constexpr const char* kTagsKey = "tags";

// None where the key is absent. `of`: what the item is, kOfPerturbation for one. Throws InputError: a name that is no
// plain one or that duet gives itself, a value that is no plain name, a level, stage or seed that is no whole number.
Tags read_tags(const YamlSection& item, std::string_view of);

// ", tags: {level: 3}", to stand in a mapping behind another key; "" for none.
std::string tags_yaml(const Tags& tags);

}  // namespace duet
