// Functions that the readers of a suite's keys share.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "duet/robots/yaml_section.h"

namespace duet {

// Runs `read` and puts file, line and key before the message of a std::invalid_argument.
void checked(const YamlSection& section, const char* key, const std::function<void()>& read);

// The names of a list; none where the key is absent.
std::vector<std::string> names_in(const YamlSection& section, const char* key);

// The mapping under `key`, empty where it is absent.
YamlSection section_below(const YamlSection& parent, const std::string& file, const std::string& key,
                          const std::vector<const char*>& known);

// The text in double quotes, as YAML reads it.
std::string yaml_quoted(const std::string& text);

}  // namespace duet
