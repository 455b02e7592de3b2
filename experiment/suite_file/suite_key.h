// One key of a suite: how it is read, written in the resolved form (which is hashed), and what is said of it.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "duet/experiment/suite/suite.h"
#include "duet/robots/yaml_schema.h"
#include "duet/robots/yaml_section.h"

namespace duet {

struct SuiteKey : SchemaKey<Suite> {
  // Whether a suite whose roots move by command (`reference`) has it.
  enum class With { kBoth, kClips, kReference };

  SuiteKey(SchemaKey<Suite> key, With where = With::kBoth) : SchemaKey<Suite>(std::move(key)), with(where) {}

  With with;
};

// The forms that a suite's keys have: a field of the suite, a mapping that another room checks.

enum class KeyForm { kAsIs, kQuoted, kUnlessDefault, kQuotedUnlessEmpty };  // of a value in the resolved form

// The key that a field names.
SuiteKey plain_key(const Field<Suite>& value, SuiteKey::With with = SuiteKey::With::kBoth,
                   KeyForm form = KeyForm::kAsIs);
SuiteKey required_key(const Field<Suite>& value, KeyForm form);

// A mapping from names to values: `check` throws std::invalid_argument for each of them alone, then for all together.
using SuiteChoices = std::map<std::string, std::string>;
SuiteKey choices_key(const std::string& name, const FieldRow& row, SuiteChoices Suite::*member,
                     const std::function<void(const SuiteChoices&)>& check);

// Functions that the readers of a suite's keys share.

// Runs `read` and puts file, line and key before the message of a std::invalid_argument.
void checked(const YamlSection& section, const char* key, const std::function<void()>& read);

// The names of a list; none where the key is absent.
std::vector<std::string> names_in(const YamlSection& section, const char* key);

// The mapping under `key`, empty where it is absent.
YamlSection section_below(const YamlSection& parent, const std::string& file, const std::string& key,
                          const std::vector<const char*>& known);

// The text in double quotes, as YAML reads it.
std::string yaml_quoted(const std::string& text);

// The keys of a suite: one table, from which suite files are read, checked, written in their resolved form (which is
// hashed), listed and documented (docs/reference/suite-keys.md).

// All keys, in the order in which they are read and written.
const std::vector<SuiteKey>& suite_keys();

}  // namespace duet
