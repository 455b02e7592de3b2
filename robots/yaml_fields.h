// Tables of fields (core/field.h) read from YAML: strictly, with file, line, key, what was expected and what was found.
#pragma once

#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/robots/yaml_section.h"

namespace duet {

// The value of a key that is there, as text. Throws InputError for a list, a mapping, nothing and "".
std::string field_node_text(const YamlSection& section, const FieldWords& words, const std::string& values);

template <typename Owner>
std::vector<const char*> field_keys(const FieldTable<Owner>& table) {
  std::vector<const char*> keys;
  keys.reserve(table.size());
  for (const Field<Owner>& known : table) keys.push_back(known.name.c_str());
  return keys;
}

// Sets the field where the section has its key. Throws InputError.
template <typename Owner>
void read_field(const YamlSection& section, const Field<Owner>& known, Owner& owner) {
  const char* key = known.name.c_str();
  if (!section.has(key)) return raise_default(known, owner);
  const std::string text = field_node_text(section, known, known.values);
  if (const std::string expected = set_field(known, owner, text); !expected.empty())
    section.fail(section.line(key), field_refusal(known, expected, text));
}

// All of them, in the order of the table.
template <typename Owner>
void read_fields(const YamlSection& section, const FieldTable<Owner>& table, Owner& owner) {
  for (const Field<Owner>& known : table) read_field(section, known, owner);
}

}  // namespace duet
