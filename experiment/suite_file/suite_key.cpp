#include "duet/experiment/suite_file/suite_key.h"

#include <fmt/format.h>

#include <stdexcept>

namespace duet {
namespace {

std::string in_form(const std::string& text, KeyForm form, const std::string& fallback) {
  if (form == KeyForm::kUnlessDefault && text == fallback) return "";
  if (form == KeyForm::kQuotedUnlessEmpty && text.empty()) return "";
  return form == KeyForm::kQuoted || form == KeyForm::kQuotedUnlessEmpty ? yaml_quoted(text) : text;
}

}  // namespace

SuiteKey plain_key(const Field<Suite>& value, SuiteKey::With with, KeyForm form) {
  SuiteKey key(field_key(value), with);
  key.write = [value, form](const Suite& suite) { return in_form(value.text(suite), form, value.text(Suite())); };
  return key;
}

SuiteKey required_key(const Field<Suite>& value, KeyForm form) {
  SuiteKey key = plain_key(value, SuiteKey::With::kBoth, form);
  key.rows.front().fallback = "required";
  key.read = [value](const YamlSection& top, Suite& suite) {
    static_cast<void>(top.text(value.name.c_str()));  // it has to be there
    read_field(top, value, suite);
  };
  return key;
}

// A map whose keys and values another room checks, each by itself and then all together.
SuiteKey choices_key(const std::string& name, const FieldRow& row, SuiteChoices Suite::*member,
                     const std::function<void(const SuiteChoices&)>& check) {
  const auto read = [name, member, check](const YamlSection& top, Suite& suite) {
    if (!top.has(name.c_str())) return;
    const YAML::Node node = top.node(name.c_str());
    if (!node.IsMap()) top.refuse_key(name.c_str(), "a mapping", node);
    const auto fail_at = [&](int line, const std::string& message) {
      top.fail(line, fmt::format("key '{}': {}", name, message));
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
  const auto write = [member](const Suite& suite) {
    std::string text;
    for (const auto& [option, value] : suite.*member) text += fmt::format("\n  {}: {}", option, value);
    return text;
  };
  return {{name, read, {row}, write}, SuiteKey::With::kClips};
}

void checked(const YamlSection& section, const char* key, const std::function<void()>& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    section.fail_key(key, error.what());
  }
}

std::vector<std::string> names_in(const YamlSection& section, const char* key) {
  std::vector<std::string> names;
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar()) section.refuse_key(key, "names", item);
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
