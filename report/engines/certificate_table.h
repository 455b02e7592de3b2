// The parity certificate that `duet validate` writes: which engines passed which scenes.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "duet/report/engines/cross_engine_result.h"
#include "duet/report/tables/text_table.h"

namespace duet {

// Engine, version, profile, checks passed, asserted deviations, failed; with a note for each of the engines of the
// results that it does not cover as it was run. Read tolerantly: what is missing is "-". null: a table without rows
// that says that none is attached.
TitledTable certificate_table(const nlohmann::json& certificate, const std::vector<RunEngine>& engines = {});

}  // namespace duet
