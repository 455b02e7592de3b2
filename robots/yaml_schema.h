// The keys of a YAML mapping, declared once: a table says which keys the mapping has, what each may be and what it
// fills, and reading, the list of known keys and the refusals follow from it. Whole keys are made of the words of
// core/field.h; a key of a form of its own brings its reader. Tables are constants; thread-safe.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "duet/core/field.h"
#include "duet/core/names.h"
#include "duet/robots/yaml_section.h"

namespace duet {

// A mapping that a schema reads, with the file that mappings below it name in messages.
struct SchemaSection : YamlSection {
  SchemaSection(const std::string& in, const YAML::Node& node, std::string where, const std::vector<const char*>& known)
      : YamlSection(in, node, std::move(where), known), file(in) {}

  std::string file;
};

// A key of a mapping that fills an Owner.
template <typename Owner>
struct SchemaKey {
  using Read = std::function<void(const SchemaSection& section, Owner& owner)>;
  using Write = std::function<std::string(const Owner& owner)>;

  SchemaKey(std::string key, Read reader = {}, std::vector<FieldRow> described = {}, Write writer = {})
      : name(std::move(key)), read(std::move(reader)), rows(std::move(described)), write(std::move(writer)) {}

  std::string name;
  Read read;                   // throws InputError; none: the key is known here, and the caller reads it
  std::vector<FieldRow> rows;  // what lists and reference pages say of it and of the keys below it
  Write write;  // the value as YAML, a block after a line's end; "" where it goes without saying, none: always so
};

template <typename Owner>
using Schema = std::vector<SchemaKey<Owner>>;

inline constexpr FieldRange kNotNegative = {.low = 0.0};
inline constexpr FieldRange kPositive = {.low = 0.0, .with_low = false};

// The value of a key that is there: finite numbers in the words' range, whole numbers, flags and enumerations of the
// words' choices, texts that are not empty, lists of these, where one number alone is a list of one. Throw InputError:
// file, line, the mapping, "key 'KEY': expected ..., found ...".
void read_value(const YamlSection& section, const FieldDoc& words, Eigen::Vector3d& out);
void read_value(const YamlSection& section, const FieldDoc& words, std::vector<double>& out);
void read_value(const YamlSection& section, const FieldDoc& words, std::vector<std::string>& out);
// The text of a key that is there; refuses a list, a mapping, nothing and "" with what was expected.
std::string scalar_text(const YamlSection& section, const FieldDoc& words, const std::string& expected);

template <typename T>
void read_value(const YamlSection& section, const FieldDoc& words, T& out) {
  FieldDoc said = words;
  if (std::is_same_v<T, bool> && said.choices.empty()) said.choices = flag_words();
  const std::string text = scalar_text(section, said, field_values<T>(said, said.range));
  if (const std::string expected = assign_field(said, text, said.range, out); !expected.empty())
    section.fail(section.line(said.name.c_str()), field_refusal(said, expected, text));
}

// Whole numbers of a list; "key 'axes': expected a whole number, 0 to 2, found 3".
std::vector<int> whole_numbers(const YamlSection& section, const FieldDoc& words);

// A key that has to be there.
template <typename Owner, typename T>
SchemaKey<Owner> required_key(const FieldDoc& words, T Owner::*member) {
  return {words.name, [=](const YamlSection& section, Owner& owner) { read_value(section, words, owner.*member); }};
}

// Sets `out` where the key is there.
template <typename T>
void read_optional(const YamlSection& section, const FieldDoc& words, T& out) {
  if (section.has(words.name.c_str())) read_value(section, words, out);
}

// A key that may be absent: its member then keeps its value.
template <typename Owner, typename T>
SchemaKey<Owner> optional_key(const FieldDoc& words, T Owner::*member) {
  return {words.name, [=](const YamlSection& section, Owner& owner) { read_optional(section, words, owner.*member); }};
}

// The keys of a schema, or of a table of fields.
template <typename Table>
std::vector<const char*> key_names(const Table& table) {
  std::vector<const char*> names;
  names.reserve(table.size());
  for (const auto& key : table) names.push_back(key.name.c_str());
  return names;
}

// Reads the mapping, which `where` names in messages ("joint 'left_knee_joint'"), in the order of the schema. An Owner
// with a `line` gets the mapping's. Returns the mapping, for what the caller checks. Throws InputError, also for a key
// that is not in the schema, with all in its order.
template <typename Owner>
SchemaSection read_mapping(const std::string& file, const YAML::Node& node, std::string where,
                           const Schema<Owner>& schema, Owner& owner) {
  SchemaSection section(file, node, std::move(where), key_names(schema));
  if constexpr (requires { owner.line; }) owner.line = section.line();
  for (const SchemaKey<Owner>& key : schema)
    if (key.read) key.read(section, owner);
  return section;
}

template <typename Part>
Part& part_of(Part& part) {
  return part;
}
template <typename Part>
Part& part_of(std::optional<Part>& part) {
  return part.emplace();
}

// A key whose value is a mapping with a schema of its own, of a member or of an optional one; an absent one leaves the
// member as it is.
template <typename Owner, typename Member, typename Part>
SchemaKey<Owner> mapping_key(const std::string& name, Member Owner::*member, const Schema<Part>& schema) {
  return {name, [name, member, schema](const SchemaSection& section, Owner& owner) {
            if (!section.has(name.c_str())) return;
            read_mapping(section.file, section.node(name.c_str()), name, schema, part_of(owner.*member));
          }};
}

// Sets the field where the section has its key. Throws InputError.
template <typename Owner>
void read_field(const YamlSection& section, const Field<Owner>& known, Owner& owner) {
  const char* key = known.name.c_str();
  if (!section.has(key)) return raise_default(known, owner);
  const std::string text = scalar_text(section, known, known.values);
  if (const std::string expected = set_field(known, owner, text); !expected.empty())
    section.fail(section.line(key), field_refusal(known, expected, text));
}

// All of them, in the order of the table.
template <typename Owner>
void read_fields(const YamlSection& section, const FieldTable<Owner>& table, Owner& owner) {
  for (const Field<Owner>& known : table) read_field(section, known, owner);
}

// Reads a mapping of nothing but fields.
template <typename Owner>
void read_fields(const std::string& file, const YAML::Node& node, const std::string& where,
                 const FieldTable<Owner>& table, Owner& owner) {
  read_fields(YamlSection(file, node, where, key_names(table)), table, owner);
}

// The key that a field names (core/field.h): read by it, written as its text, described by its row.
template <typename Owner>
SchemaKey<Owner> field_key(const Field<Owner>& value) {
  return {value.name, [value](const SchemaSection& section, Owner& owner) { read_field(section, value, owner); },
          field_rows(FieldTable<Owner>{value}, Owner()), value.text};
}

// A key whose value is a mapping of fields of the owner.
template <typename Owner>
SchemaKey<Owner> group_key(const std::string& name, const FieldTable<Owner>& table) {
  SchemaKey<Owner> key(name);
  key.read = [name, table](const SchemaSection& section, Owner& owner) {
    const YAML::Node node = section.has(name.c_str()) ? section.node(name.c_str()) : YAML::Node(YAML::NodeType::Map);
    read_fields(section.file, node, name, table, owner);
  };
  key.rows = field_rows(table, Owner());
  for (FieldRow& row : key.rows) row.name = name + '.' + row.name;
  key.write = [table](const Owner& owner) { return flow_mapping(table, owner); };
  return key;
}

// "name: value", "name:" before a block; nothing of a key that goes without saying. Each line ends.
template <typename Owner>
std::string written(const SchemaKey<Owner>& key, const Owner& owner) {
  const std::string value = key.write ? key.write(owner) : "";
  return value.empty() ? "" : key.name + (value.starts_with('\n') ? ":" : ": ") + value + '\n';
}

}  // namespace duet
