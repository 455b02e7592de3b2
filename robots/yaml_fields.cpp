#include "duet/robots/yaml_fields.h"

#include <fmt/format.h>

namespace duet {

std::string field_node_text(const YamlSection& section, const FieldWords& words, const std::string& values) {
  const YAML::Node node = section.node(words.name.c_str());
  if (!node.IsScalar() || node.Scalar().empty())
    section.fail(section.line(words.name.c_str()),
                 fmt::format("{}: expected {}, found {}", words.name, values, describe(node)));
  return node.Scalar();
}

}  // namespace duet
