// Options by name and text, of a controller or a policy: they set the fields of a struct with a table of fields
// (core/field.h). Listing, checking and documentation are made from the table.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/field.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

// `defaults` with the options that are given. Throws std::invalid_argument, which begins with `of` and the name
// ("controller 'homie': ..."): a name that is not in the table (with the nearest and all known), a text that is no
// value of its field.
template <typename Owner>
Owner read_options(std::string_view of, std::string_view name, const FieldTable<Owner>& table,
                   const std::map<std::string, std::string>& given, Owner defaults = {}) {
  check_options(of, name, given, field_names(table));
  for (const auto& [option, text] : given) {
    const Field<Owner>& known = *find_field(table, option);
    const std::string expected = set_field(known, defaults, text);
    if (!expected.empty())
      require(false, std::string(of) + " '" + std::string(name) + "': " + field_refusal(known, expected, text));
  }
  return defaults;
}

// Rows {name, fallback, about} of what a controller or a policy says of itself.
template <typename Option, typename Owner>
std::vector<Option> option_list(const FieldTable<Owner>& table, const Owner& defaults = {}) {
  std::vector<Option> list;
  list.reserve(table.size());
  for (const FieldRow& row : field_rows(table, defaults))
    list.push_back({row.name, row.fallback, row.values + "; " + row.meaning});
  return list;
}

}  // namespace duet
