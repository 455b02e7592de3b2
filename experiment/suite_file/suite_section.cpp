#include "duet/experiment/suite_file/suite_section.h"

#include <fmt/format.h>

#include <stdexcept>

namespace duet {

void checked(const YamlSection& section, const char* key, const std::function<void()>& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    section.fail(section.has(key) ? section.line(key) : section.line(), fmt::format("{}: {}", key, error.what()));
  }
}

std::vector<std::string> names_in(const YamlSection& section, const char* key) {
  std::vector<std::string> names;
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar())
      section.fail(section.line(key), fmt::format("{}: expected names, found {}", key, describe(item)));
    names.push_back(item.Scalar());
  }
  return names;
}

YamlSection section_below(const YamlSection& parent, const std::string& file, const std::string& key,
                          const std::vector<const char*>& known) {
  return {file, parent.has(key.c_str()) ? parent.node(key.c_str()) : YAML::Load("{}"), key, known};
}

std::string yaml_quoted(const std::string& text) {
  std::string escaped;
  for (const char c : text) escaped += c == '"' || c == '\\' ? std::string{'\\', c} : std::string{c};
  return '"' + escaped + '"';
}

}  // namespace duet
