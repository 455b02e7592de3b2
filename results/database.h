// results.sqlite, derived from rows and rebuildable: tables episodes, metrics, forces, contacts,
// verdicts (schema in docs/file-formats.md); traces stay in the rows.
#pragma once

#include <string>
#include <vector>

#include "results/episode_row.h"

namespace duet {

// Replaces the file. Throws InputError.
void write_database(const std::vector<EpisodeRow>& rows, const std::string& path);

}  // namespace duet
