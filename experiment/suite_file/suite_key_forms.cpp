#include "duet/experiment/suite_file/suite_key_forms.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "duet/experiment/suite_file/suite_section.h"
#include "duet/robots/yaml_fields.h"

namespace duet {
namespace {

using With = SuiteKey::With;

std::string written(const Field<Suite>& value, KeyForm form, const Suite& suite) {
  const std::string text = value.text(suite);
  if (form == KeyForm::kUnlessDefault && text == value.text(Suite())) return "";
  if (form == KeyForm::kQuotedUnlessEmpty && text.empty()) return "";
  const bool quoted = form == KeyForm::kQuoted || form == KeyForm::kQuotedUnlessEmpty;
  return fmt::format("{}: {}\n", value.name, quoted ? yaml_quoted(text) : text);
}

}  // namespace

// A key whose value is one field of the suite.
SuiteKey plain_key(Field<Suite> value, With with, KeyForm form) {
  SuiteKey key{value.name, field_rows(FieldTable<Suite>{value}, Suite()), with};
  key.read = [value](const YamlSection& top, Suite& suite) { read_field(top, value, suite); };
  key.write = [value = std::move(value), form](const Suite& suite) { return written(value, form, suite); };
  return key;
}

SuiteKey required_key(Field<Suite> value, KeyForm form) {
  SuiteKey key = plain_key(value, With::kBoth, form);
  key.rows.front().fallback = "required";
  key.read = [value = std::move(value)](const YamlSection& top, Suite& suite) {
    static_cast<void>(top.text(value.name.c_str()));  // it has to be there
    read_field(top, value, suite);
  };
  return key;
}

// A key whose value is a mapping of fields of the suite.
SuiteKey group_key(const std::string& name, const FieldTable<Suite>& table, With with) {
  SuiteKey key{name, field_rows(table, Suite()), with};
  for (FieldRow& row : key.rows) row.name = name + '.' + row.name;
  key.read = [name, table](const YamlSection& top, Suite& suite) {
    read_fields(section_below(top, suite.file, name, field_keys(table)), table, suite);
  };
  key.write = [name, table](const Suite& suite) { return name + ": " + flow_mapping(table, suite) + '\n'; };
  return key;
}

// A map whose keys and values another room checks, each by itself and then all together.
SuiteKey choices_key(const std::string& name, const FieldRow& row, SuiteChoices Suite::*member,
                     const std::function<void(const SuiteChoices&)>& check) {
  SuiteKey key{name, {row}, With::kClips};
  key.read = [name, member, check](const YamlSection& top, Suite& suite) {
    if (!top.has(name.c_str())) return;
    const YAML::Node node = top.node(name.c_str());
    if (!node.IsMap())
      top.fail(top.line(name.c_str()), fmt::format("{}: expected a mapping, found {}", name, describe(node)));
    const auto fail_at = [&](int line, const std::string& message) {
      top.fail(line, fmt::format("{}: {}", name, message));
    };
    SuiteChoices& found = suite.*member;
    for (const auto& entry : node) {
      const std::string option = entry.first.as<std::string>();
      if (!entry.second.IsScalar())
        top.fail(entry.first.Mark().line + 1,
                 fmt::format("{}.{}: expected one value, found {}", name, option, describe(entry.second)));
      try {
        check({{option, entry.second.Scalar()}});
      } catch (const std::invalid_argument& error) {
        fail_at(entry.first.Mark().line + 1, error.what());
      }
      found[option] = entry.second.Scalar();
    }
    checked(top, name.c_str(), [&] { check(found); });
  };
  key.write = [name, member](const Suite& suite) {
    std::string text = (suite.*member).empty() ? "" : name + ":\n";
    for (const auto& [option, value] : suite.*member) text += fmt::format("  {}: {}\n", option, value);
    return text;
  };
  return key;
}

}  // namespace duet
