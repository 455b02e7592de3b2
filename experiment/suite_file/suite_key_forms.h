// The forms that a suite's keys have: a field of the suite, a mapping that another room checks.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "duet/experiment/suite_file/suite_key.h"

namespace duet {

enum class KeyForm { kAsIs, kQuoted, kUnlessDefault, kQuotedUnlessEmpty };  // of a value in the resolved form

// The key that a field names.
SuiteKey plain_key(const Field<Suite>& value, SuiteKey::With with = SuiteKey::With::kBoth,
                   KeyForm form = KeyForm::kAsIs);
SuiteKey required_key(const Field<Suite>& value, KeyForm form);

// A mapping from names to values: `check` throws std::invalid_argument for each of them alone, then for all together.
using SuiteChoices = std::map<std::string, std::string>;
SuiteKey choices_key(const std::string& name, const FieldRow& row, SuiteChoices Suite::*member,
                     const std::function<void(const SuiteChoices&)>& check);

}  // namespace duet
