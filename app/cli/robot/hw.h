// The commands of a real robot and of its twin: `duet hw`, `duet replay-log`.
#pragma once

#include "duet/app/command.h"

namespace duet::cli {

void add_hardware(CLI::App& app, Session& session);
void add_replay_log(CLI::App& app, Session& session);

}  // namespace duet::cli
