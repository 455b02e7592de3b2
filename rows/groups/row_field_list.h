// A row's fields for people: what `duet list row-fields` and docs/reference/row-fields.md say.
#pragma once

#include <string>
#include <vector>

namespace duet {

struct RowFieldInfo {
  std::string name, type, meaning;    // "sim_s", "number or null", "simulated time [s]"
  std::vector<std::string> columns;   // of the table `episodes` in results.sqlite
  std::vector<RowFieldInfo> members;  // of an object, or of each object of a list
};

// `schema`, then all of them in the order of their table.
std::vector<RowFieldInfo> row_field_list();

}  // namespace duet
