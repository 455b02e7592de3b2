// The parity certificate that `duet validate` writes: which engines passed which scenes. Read tolerantly: the report
// shows what is there.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/results/analyses/cross_engine.h"

namespace duet {

// Heading of level 3 and a table: engine, version, profile, checks passed, asserted deviations, failed. `engines` of
// the results: one that the certificate does not cover, or of another version or profile, is named. For null the
// sentence that none is attached.
std::string certificate_markdown(const nlohmann::json& certificate, const std::vector<RunEngine>& engines = {});

}  // namespace duet
