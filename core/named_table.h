// Tables whose entries people choose by name: the names, the entry of a name, the refusal of an unknown one. Pure
// functions; thread-safe.
#pragma once

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/names.h"

namespace duet {

// The member `name` of each entry, in the order of the table.
template <typename Table>
std::vector<std::string> names_of(const Table& table) {
  std::vector<std::string> names;
  names.reserve(std::size(table));
  for (const auto& entry : table) names.emplace_back(entry.name);
  return names;
}

// Throws std::invalid_argument with the sentence of unknown_name_message where `name` is not `known`.
inline void require_known(std::string_view kind, std::string_view name, const std::vector<std::string>& known) {
  if (std::ranges::find(known, name) == known.end())
    throw std::invalid_argument(unknown_name_message(kind, name, known));
}

// The entry of that name; throws as above. A reference into `table`, which outlives it.
template <typename Table>
const auto& entry_named(const Table& table, std::string_view kind, std::string_view name) {
  for (const auto& entry : table)
    if (entry.name == name) return entry;
  throw std::invalid_argument(unknown_name_message(kind, name, names_of(table)));
}

}  // namespace duet
