// The setup of a limiter as JSON, so that a log can be passed through the same one again.
#pragma once

#include <nlohmann/json.hpp>

#include "duet/hardware/safety/limiter.h"

namespace duet {

nlohmann::json limiter_setup_json(const LimiterSetup& setup);
// Throws InputError naming `name` for JSON that is not of that form, or another robot than the one whose card is here.
LimiterSetup parse_limiter_setup(const nlohmann::json& json, const std::string& name);

}  // namespace duet
