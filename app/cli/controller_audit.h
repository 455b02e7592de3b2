// duet controller audit, a command beside `duet controller import`.
#pragma once

#include "duet/app/command.h"

namespace duet::cli {

void add_controller_audit(CLI::App& controller, Session& session);

}  // namespace duet::cli
