// results.sqlite, derived from rows and rebuildable: tables episodes, metrics, forces, contacts,
// verdicts, notes (schema in docs/file-formats.md); traces stay in the rows.
#pragma once

#include <string>
#include <vector>

#include "duet/results/rows/episode_row.h"

namespace duet {

// Replaces the file. `notes` are what has to be said of the rows (table notes). Throws InputError.
void write_database(const std::vector<EpisodeRow>& rows, const std::string& path,
                    const std::vector<std::string>& notes = {});

}  // namespace duet
