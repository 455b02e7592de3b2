// results.sqlite, derived from rows and rebuildable: tables episodes, metrics, forces, contacts, verdicts, notes
// (docs/file-formats.md). The columns of an episode come from the table of a row's fields; traces stay in the rows.
#pragma once

#include <string>
#include <vector>

#include "duet/rows/episode_row.h"

namespace duet {

// Replaces the file. `notes` are what has to be said of the rows (table notes). Throws InputError.
void write_database(const std::vector<EpisodeRow>& rows, const std::string& path,
                    const std::vector<std::string>& notes = {});

// The columns of the table `episodes` that hold a field of a row; none of a mapping, a list and a trace.
std::vector<std::string> database_columns(const RowField& field);

// A row's fields for people: what `duet list row-fields` and docs/reference/row-fields.md say.

struct RowFieldInfo {
  std::string name, type, meaning;    // "sim_s", "number or null", "simulated time [s]"
  std::vector<std::string> columns;   // of the table `episodes` in results.sqlite
  std::vector<RowFieldInfo> members;  // of an object, or of each object of a list
};

// `schema`, then all of them in the order of their table.
std::vector<RowFieldInfo> row_field_list();

}  // namespace duet
